"""Parsers of a modem's answers, except those with test files of their own."""

from ipaddress import ip_address

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.wire.at.answers import (
    Attempts,
    PacketContext,
    Registration,
    RegistrationState,
    Sim,
    addresses,
    attempts,
    flag,
    operator,
    packet_contexts,
    registration,
    signal_dbm,
    sim,
    sim_error,
    system_mode,
    temperature_c,
    usb_id,
)

HOME, ROAMING = RegistrationState.HOME, RegistrationState.ROAMING


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("+CREG: 0,1", Registration("CREG", HOME)),
        ("+CREG: 1", Registration("CREG", HOME)),
        ('+CEREG: 2,1,"5A1E","0B28A00C",7', Registration("CEREG", HOME, 0x5A1E, 0x0B28A00C, 7)),
        ('+CEREG: 5,"5A1E","0B28A00C",13', Registration("CEREG", ROAMING, 0x5A1E, 0x0B28A00C, 13)),
        ("+CREG: 2,1,00D3,0B28A00C,7", Registration("CREG", HOME, 0xD3, 0x0B28A00C, 7)),
        ("+CREG: 1,00D3,0B28A00C", Registration("CREG", HOME, 0xD3, 0x0B28A00C)),
        ('+C5GREG: 2,1,"00765D","00004B9C90",11,1,"01"', Registration("C5GREG", HOME, 0x765D, 0x4B9C90, 11)),
        ("+CGREG: 0,3", Registration("CGREG", RegistrationState.DENIED)),
        ("+CGREG: 2", Registration("CGREG", RegistrationState.SEARCHING)),
    ],
)
def test_a_registration_is_read_asked_for_and_unasked(line, wanted):
    assert registration(line) == wanted


@pytest.mark.parametrize(
    ("state", "is_registered"), [(0, False), (1, True), (2, False), (3, False), (5, True), (6, False), (8, False)]
)
def test_packets_are_carried_at_home_and_roaming(state, is_registered):
    assert registration(f"+CEREG: 0,{state}").is_registered is is_registered


def test_an_operator_has_a_name_while_there_is_one():
    assert operator('+COPS: 0,0,"Telekom.de",7') == "Telekom.de"
    assert operator('+COPS: 1,2,"26201"') == "26201"
    assert operator("+COPS: 0") == ""


@pytest.mark.parametrize(("rssi", "dbm"), [(0, -113), (20, -73), (31, -51), (99, None), (199, None), (116, -100)])
def test_a_signal_is_in_dbm(rssi, dbm):
    assert signal_dbm(f"+CSQ: {rssi},99") == dbm


@pytest.mark.parametrize(
    ("line", "mode"), [("+CNSMOD: 1,8", "lte"), ("+CNSMOD: 0", "none"), ("+CNSMOD: 16", "mode 16")]
)
def test_a_system_mode_has_its_name_if_there_is_one(line, mode):
    assert system_mode(line) == mode


def test_a_temperature_may_be_below_zero():
    assert [temperature_c("+CPMUTEMP: 38"), temperature_c("+CPMUTEMP: -12")] == [38, -12]


def test_addresses_of_both_versions_are_read():
    line = '+CGPADDR: 1,"10.64.1.2","32.1.13.184.0.0.0.0.0.0.0.0.0.0.0.1"'
    assert addresses([line]) == [ip_address("10.64.1.2"), ip_address("2001:db8::1")]
    assert addresses(['+CGPADDR: 1,"10.64.1.2","2001:db8::1"']) == addresses([line])
    assert addresses(['+CGPADDR: 1,"0.0.0.0"', "+CGPADDR: 2", '+CGPADDR: 3,""']) == []


@pytest.mark.parametrize(
    ("code", "state"), [("READY", Sim.READY), ("SIM PIN", Sim.PIN), ("SIM PUK", Sim.PUK), ("PH-NET PIN", Sim.LOCKED)]
)
def test_the_state_of_a_sim_is_read(code, state):
    assert sim(f"+CPIN: {code}") is state


def test_an_error_in_its_place_says_the_state_as_number_and_as_text():
    assert [sim_error(10, ""), sim_error(14, ""), sim_error(13, ""), sim_error(12, "")] == [
        Sim.ABSENT, Sim.BUSY, Sim.FAILED, Sim.PUK,
    ]  # fmt: skip
    assert [sim_error(None, "SIM not inserted"), sim_error(None, "SIM busy"), sim_error(None, "?")] == [
        Sim.ABSENT, Sim.BUSY, Sim.BUSY,
    ]  # fmt: skip


def test_attempts_flags_and_usb_ids_are_read():
    assert attempts("+SPIC: 3,10,0,10") == Attempts(pin=3, puk=10)
    assert [flag("+CGATT: 1", "+CGATT"), flag("+CGACT: 1,0", "+CGACT")] == [1, 0]
    assert usb_id(["USBADB: 0", "USBID: 0X1E0E,0X9078"]) == (0x1E0E, 0x9078)


def test_a_packet_context_has_what_its_line_says_of_it():
    assert packet_contexts(['+CGDCONT: 1,"ip","internet","0.0.0.0",0,0', "+CGDCONT: 2", "+CGDCONT: 3,"]) == [
        PacketContext(1, "IP", "internet"), PacketContext(2), PacketContext(3),
    ]  # fmt: skip


PARSERS = [
    (registration, "+CREG: "), (operator, "+COPS: "), (signal_dbm, "+CSQ: "),
    (system_mode, "+CNSMOD: "), (temperature_c, "+CPMUTEMP: "), (sim, "+CPIN: "), (attempts, "+SPIC: "),
    (lambda line: addresses([line]), "+CGPADDR: "), (lambda line: packet_contexts([line]), "+CGDCONT: "),
    (lambda line: usb_id([line]), "USBID: "),
]  # fmt: skip


@pytest.mark.parametrize(("parser", "prefix"), PARSERS)
@given(rest=st.text(max_size=30) | st.lists(st.integers().map(str) | st.just('""')).map(",".join))
def test_any_line_is_read_or_explained(parser, prefix, rest):
    for line in (prefix + rest, rest):
        try:
            parser(line)
        except ProtocolError as error:
            assert error.message
