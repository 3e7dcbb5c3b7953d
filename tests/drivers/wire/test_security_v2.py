"""Envelopes of TS 103 097 V1.2.1: all header and certificate fields, and invalid ones."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.wire.security import Unwrapped, unwrap

PAYLOAD = bytes.fromhex("2050 0080 0004 0100") + bytes(28) + bytes.fromhex("07d10000")
TIME = b"\x00" + bytes(8)
CAM = b"\x05\x24"  # ITS-AID 36
DIGEST = b"\x80\x01" + bytes(8)
SIGNED, SIGNATURE = 1, b"\x01\x00\x00" + bytes(64)
POINTS = [b"\x00" + bytes(32), b"\x02" + bytes(32), b"\x03" + bytes(32), b"\x04" + bytes(64)]
CAM_MAY, DENM_MAY = b"\x24\x03\x01\x02\x03", b"\x25\x04\x01\xff\xff\xff"


def number(value: int) -> bytes:
    """Return a number as IntX of at most three octets."""
    if value < 1 << 7:
        return bytes([value])
    return (1 << 15 | value).to_bytes(2) if value < 1 << 14 else (6 << 21 | value).to_bytes(3)


def vector(content: bytes) -> bytes:
    return number(len(content)) + content


def envelope(*fields: bytes, kind: int = SIGNED, payload: bytes = PAYLOAD, trailer: bytes = SIGNATURE) -> bytes:
    header = vector(b"".join(fields or (DIGEST, TIME, CAM)))
    return b"\x02" + header + bytes([kind]) + vector(payload) + vector(trailer)


def certificate(
    *attributes: bytes, issuer: bytes = b"\x01" + bytes(8), name: bytes = b"", key: bytes = POINTS[2]
) -> bytes:
    """Return signer info with one certificate: version, issuer, subject, attributes, validity, signature."""
    subject = b"\x01" + vector(name)
    all_of_them = vector(b"\x00\x00" + key + b"\x02\x60" + b"".join(attributes))
    return b"\x80\x02" + b"\x02" + issuer + subject + all_of_them + vector(b"\x01" + bytes(8)) + SIGNATURE[1:]


# --- contents ---


def test_a_signed_payload_comes_with_its_application() -> None:
    assert unwrap(envelope()) == Unwrapped(PAYLOAD, 36, b"")


@pytest.mark.parametrize(
    "field",
    [
        b"\x00" + bytes(8),  # generation time
        b"\x01" + bytes(9),  # and its standard deviation
        b"\x02" + bytes(4),  # expiration
        b"\x03" + bytes(10),  # generation location
        b"\x04\x06" + bytes(6),  # request of two certificates
        b"\x80\x00",  # signer: none
        DIGEST,
        b"\x80\x03\x02\x02\x02",  # a chain
        b"\x80\x04\x00" + bytes(8),  # digest by another algorithm
        b"\x80\x63\x02\xab\xcd",  # unknown signer
        b"\x63\x03abc",  # unknown field
    ],
)
def test_the_application_is_found_behind_every_field(field: bytes) -> None:
    assert unwrap(envelope(field, CAM)) == Unwrapped(PAYLOAD, 36, b"")


@pytest.mark.parametrize("its_aid", [0, 36, 127, 128, 141, 637, 16383, 16384, 2_097_151])
def test_the_application_is_read_whatever_its_number_of_octets(its_aid: int) -> None:
    assert unwrap(envelope(b"\x05" + number(its_aid))).its_aid == its_aid


def test_without_an_application_it_is_0() -> None:
    assert unwrap(envelope(TIME, DIGEST)) == Unwrapped(PAYLOAD, 0, b"")


@pytest.mark.parametrize("size", [0, 127, 128, 1400, 16384])
def test_the_length_of_the_payload_does_not_matter(size: int) -> None:
    assert unwrap(envelope(payload=bytes(size)) + b"padding").payload == bytes(size)


@pytest.mark.parametrize("key", POINTS)
@pytest.mark.parametrize("issuer", [b"\x00", b"\x01" + bytes(8), b"\x04" + bytes(9), b"\x63\x02ab"])
def test_a_certificate_says_what_its_owner_may_send(key: bytes, issuer: bytes) -> None:
    signer = certificate(b"\x20\x01\x24", b"\x21" + vector(DENM_MAY + CAM_MAY), issuer=issuer, name=b"car", key=key)
    assert unwrap(envelope(signer, TIME, CAM)) == Unwrapped(PAYLOAD, 36, b"\x01\x02\x03")


@pytest.mark.parametrize("attributes", [b"", b"\x21" + vector(DENM_MAY), b"\x21" + vector(b"\x24" + vector(bytes(33)))])
def test_a_certificate_that_does_not_say_it_has_no_ssp(attributes: bytes) -> None:
    assert unwrap(envelope(certificate(attributes), CAM)).ssp == b""


@pytest.mark.parametrize(
    "attribute",
    [b"\x01\x01\x00" + POINTS[3], b"\x03" + POINTS[0], b"\x22\x02\x24\x01", b"\x63\x02ab", b"\x00\x63\x02ab"],
)
def test_every_attribute_of_a_certificate_is_walked_over(attribute: bytes) -> None:
    assert unwrap(envelope(certificate(attribute, b"\x21" + vector(CAM_MAY)), CAM)).ssp == b"\x01\x02\x03"


# --- invalid packets ---


@pytest.mark.parametrize(
    ("octets", "why"),
    [
        (envelope(kind=0), "unsecured payload"),
        (envelope(kind=2), "encrypted payload"),
        (envelope(kind=3), "external payload"),
        (envelope(kind=4), "encrypted payload"),
        (envelope(kind=99), "unknown payload"),
        (envelope(DIGEST, b"\x81\x00" + bytes(12), CAM), "encrypted data"),
        (envelope(DIGEST, b"\x82\x00", CAM), "encrypted data"),
        (envelope(trailer=b""), "no signature"),
        (envelope(trailer=b"\x63\x01a"), "no signature"),
        (envelope(trailer=SIGNATURE[:-1]), "1 octets longer"),
        (envelope(TIME[:-1]), "1 octets longer"),
        (envelope(certificate(b"\x21" + vector(CAM_MAY[:-1])), CAM), "1 octets longer"),
        (envelope(b"\x80\x02\x02\x02" * 300), "certificate in a certificate"),
        (b"\x02\xff" + b"\xff" * 60, "truncated"),
        (b"\x01" + envelope()[1:], "unknown version of the envelope: 1"),
    ],
)
def test_what_is_not_signed_or_malformed_is_refused_with_its_cause(octets: bytes, why: str) -> None:
    with pytest.raises(ProtocolError, match=f"security: .*{why}"):
        unwrap(octets)


@pytest.mark.parametrize("octets", [envelope(), envelope(certificate(b"\x21" + vector(CAM_MAY)), TIME, CAM)])
def test_an_envelope_cut_off_at_any_octet_is_refused(octets: bytes) -> None:
    for cut in range(len(octets)):
        with pytest.raises(ProtocolError):
            unwrap(octets[:cut])


WHOLE = envelope(certificate(b"\x21" + vector(CAM_MAY + DENM_MAY)), TIME, CAM)


@given(octets=st.binary(max_size=200))
@settings(deadline=None, max_examples=1000)
def test_random_octets_are_refused_or_unwrapped(octets: bytes) -> None:
    for start in (b"\x02", b"\x02\x80\x80\x80\x02\x02", WHOLE[:20], WHOLE[:60], WHOLE[:-80]):
        assert_refused_or_unwrapped(start + octets)


@given(places=st.lists(st.tuples(st.integers(1, len(WHOLE) - 1), st.integers(0, 255)), min_size=1, max_size=4))
@settings(deadline=None, max_examples=1000)
def test_wrong_octets_are_refused_or_unwrapped(places: list[tuple[int, int]]) -> None:
    octets = bytearray(WHOLE)
    for place, octet in places:
        octets[place] = octet
    assert_refused_or_unwrapped(bytes(octets))


def assert_refused_or_unwrapped(octets: bytes) -> None:
    try:
        found = unwrap(octets)
    except ProtocolError as error:
        assert error.message.startswith("security: ")
    else:
        assert found.payload in octets
        assert len(found.ssp) <= 32
