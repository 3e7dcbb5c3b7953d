"""From when until when a certificate holds."""

import ssl
from datetime import UTC, datetime, timedelta

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from firmware import x509
from firmware.x509 import Validity
from tests.broker.fixtures import certificates

__all__ = ["certificates"]


def element(tag: int, *parts: bytes) -> bytes:
    """Source: X.690, clause 8.1; a length below 128."""
    octets = b"".join(parts)
    return bytes((tag, len(octets))) + octets


def certificate(begin: bytes, end: bytes, version: bytes = b"") -> bytes:
    """As much of one as is looked at, and no more. Source: RFC 5280, clause 4.1."""
    number, name = element(0x02, b"\x01"), element(0x30)
    return element(0x30, element(0x30, version, number, name, name, element(0x30, begin, end)))


def day(year: int) -> datetime:
    return datetime(year, 5, 6, 7, 8, 9, tzinfo=UTC)


SHORT, LONG = element(0x17, b"260506070809Z"), element(0x18, b"20500506070809Z")


@pytest.mark.parametrize("version", [b"", element(0xA0, element(0x02, b"\x02"))])
def test_a_date_of_either_form_is_read_of_a_certificate_of_either_version(version: bytes):
    assert x509.validity(certificate(SHORT, LONG, version)) == Validity(day(2026), day(2050))


@pytest.mark.parametrize("date", [element(0x17, b"tomorrow"), element(0x17, b"\xff"), element(0x0C, b"260506070809Z")])
def test_what_is_no_date_is_refused_by_its_name(date: bytes):
    with pytest.raises(ProtocolError, match="notBefore: invalid time"):
        x509.validity(certificate(date, LONG))
    with pytest.raises(ProtocolError, match="notAfter: invalid time"):
        x509.validity(certificate(SHORT, date))


def test_a_chain_holds_while_all_of_it_does_and_authorities_while_one_of_them_does():
    found = [Validity(day(2024), day(2030)), Validity(day(2026), day(2028))]
    assert x509.period(found, is_any=False) == Validity(day(2026), day(2028))
    assert x509.period(found, is_any=True) == Validity(day(2024), day(2030))


@given(st.binary(max_size=200))
def test_any_octets_are_a_certificate_or_refused(octets: bytes):
    try:
        found = x509.validity(octets)
    except ProtocolError:
        return
    assert found.begin.tzinfo is found.end.tzinfo is UTC


def test_the_end_of_a_certificate_is_what_it_was_made_for(certificates):
    ((begin, end),) = x509.validities(certificates.client.certificate.read_text())
    assert abs(begin - datetime.now(UTC)) < timedelta(hours=1)
    assert abs(end - datetime.now(UTC) - timedelta(days=2)) < timedelta(hours=1)
    (past,) = x509.validities(certificates.expired_client.certificate.read_text())
    assert past.end < datetime.now(UTC)


def test_a_file_of_several_certificates_has_an_end_for_each(certificates):
    files = (certificates.client.certificate, certificates.expired_client.certificate)
    assert len(x509.validities("\n".join(path.read_text() for path in files))) == 2


@given(cut=st.integers(0, 400), flips=st.lists(st.tuples(st.integers(0, 399), st.integers(0, 255)), max_size=4))
def test_a_damaged_certificate_has_an_end_or_is_refused(certificates, cut, flips):
    octets = bytearray(ssl.PEM_cert_to_DER_cert(certificates.client.certificate.read_text()))
    for place, octet in flips:
        octets[place % len(octets)] = octet
    try:
        found = x509.validity(bytes(octets[: len(octets) - cut]))
    except ProtocolError:
        return
    assert found.begin.tzinfo is found.end.tzinfo is UTC
