"""Redaction of the journal: secrets are removed, useful text stays."""

import pytest

from drivers.wire.redact import redact, redact_garbage


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("867584030123456", "<15 digits>"),
        ("+CICCID: 89490200001234567890", "+CICCID: <20 digits>"),
        ("+CICCID: 8949020000123456789F", "+CICCID: <20 digits>"),
        ("IMEI: 867584030123456", "IMEI: <personal>"),
        ("SN: MP0620A1B2C3", "SN: <personal>"),
        ('AT+CPIN="1234"', "AT+CPIN=<secret>"),
        ('AT+CGAUTH=1,1,"user","word"', "AT+CGAUTH=<secret>"),
        ("ATD+4915112345678;", "ATD<number>;"),
        ('+CLIP: "07712345678",129', "+CLIP:<personal>"),
        ("MISSED_CALL: 11:01AM 07712345678", "MISSED_CALL:<personal>"),
        ("0791947101670000040C91947112325476000022", "<40 digits>"),
        ("face861234567890123", "<19 digits>"),
        ("0861234567890123A", "<17 digits>"),
        ("x861234567890123y", "x<15 digits>y"),
        ("1.861234567890123", "1.<15 digits>"),
        ("IMEI 861234567890123", "IMEI <15 digits>"),
        ('PIN="1234"', "PIN=<secret>"),
        ('+CGEV: "+49151234"', '+CGEV: "<number>"'),
    ],
)
def test_who_somebody_is_is_not_shown(line, shown):
    assert redact(line) == shown


@pytest.mark.parametrize(
    "line",
    [
        "+CPSI: NR5G_SA,Online,242-12,0x765D,68719476735,0,NR5G_BAND78,640704,-770,-110,290",
        '+COPS: 0,0,"Telekom.de",7',
        '+CGPADDR: 1,"10.64.1.2","2001:db8::1"',
        "+CGMR: LE13B04SIM8202M44A-M2",
        "AT+CPIN?",
        "+CPIN: READY",
    ],
)
def test_what_an_operator_needs_is_shown(line):
    assert redact(line) == line


@pytest.mark.parametrize(
    ("octets", "shown"),
    [
        (b"\xff8675840", "\\xff<7 digits>"),
        (b"86123\x0045678", "86123\x0045678"),
        (b'+CPIN="1234"', "+CPIN=<secret>"),
        (b"garbage 12345", "garbage 12345"),
    ],
)
def test_of_what_is_garbled_no_number_of_length_is_shown(octets, shown):
    assert redact_garbage(octets) == shown
