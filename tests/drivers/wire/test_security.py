"""Signed packets: contents of captured ones, optional fields, truncated and invalid ones."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.wire.security import Unwrapped, unwrap
from tests.drivers.wire.captured import SIGNED, packet

PAYLOAD = bytes.fromhex("2050 0080 0004 0100") + bytes(28) + bytes.fromhex("07d10000")
SIGNATURE = bytes.fromhex("8080") + bytes(64)
DIGEST = b"\x80" + bytes(8)
KEY = b"\x80\x82" + bytes(32)  # ecdsaNistP256, compressed-y-0


def signed(header=b"\x00\x01\x24", signer=DIGEST, payload=None, signature=SIGNATURE):
    """Return Ieee1609Dot2Data around PAYLOAD. header: octets of HeaderInfo."""
    if payload is None:
        payload = b"\x40\x03\x80" + bytes([len(PAYLOAD)]) + PAYLOAD
    return b"\x03\x81\x00" + payload + header + signer + signature


def certificate(permissions=b"", region=b"", identity=b"\x83", encryption_key=b"", version_2_additions=b""):
    """Return a chain of one certificate as signer. Empty permissions, region or key are left out."""
    preamble = (
        (0x80 if version_2_additions else 0)
        | (0x40 if region else 0)
        | (0x10 if permissions else 0)
        | (0x01 if encryption_key else 0)
    )
    to_be_signed = bytes([preamble]) + identity + bytes(3 + 2 + 4) + b"\x84\x00\x17"
    to_be_signed += region + permissions + encryption_key + b"\x80" + KEY + version_2_additions
    return b"\x81\x01\x01" + b"\x80\x03\x00\x80" + bytes(8) + to_be_signed + SIGNATURE


CAM_MAY = bytes.fromhex("0102 80 0124 81 04 03 010203 80 0125 81 05 04 01ffffff")  # bitmaps for CAM and DENM


def assert_cut_anywhere_is_refused(octets):
    for cut in range(len(octets)):
        with pytest.raises(ProtocolError):
            unwrap(octets[:cut])


# --- contents ---


@pytest.mark.parametrize("name", SIGNED)
def test_a_captured_signed_packet_gives_what_was_signed(name):
    found = unwrap(packet(name)[4:])
    assert len(found.payload) == 8 + 28 + 4 + 41
    assert found.payload.hex().startswith("2050008000")
    assert found.its_aid == 36


def test_a_certificate_says_what_its_owner_may_send():
    assert unwrap(packet("cam-signed-certificate")[4:]).ssp == bytes.fromhex("010000")
    assert unwrap(packet("cam-signed-digest")[4:]).ssp == b""


def test_a_digest_gives_the_payload_and_the_service():
    assert unwrap(signed()) == Unwrapped(PAYLOAD, 36, b"")


@pytest.mark.parametrize(
    ("octets", "its_aid"), [("0124", 36), ("0125", 37), ("02008b", 139), ("021234", 0x1234), ("0410204081", 270549121)]
)
def test_an_its_aid_may_have_any_number_of_octets(octets, its_aid):
    assert unwrap(signed(b"\x00" + bytes.fromhex(octets))).its_aid == its_aid


@pytest.mark.parametrize(
    "header",
    [
        "40 0124" + "00" * 8,  # generationTime
        "60 0124" + "00" * 16,  # and expiryTime
        "50 0124" + "00" * 18,  # generationTime and generationLocation, as in a DENM
        "08 0124 010203",  # p2pcdLearningRequest
        "04 0124 00" + "00" * 5,  # missingCrlIdentifier
        "02 0124 81 80" + "00" * 16,  # encryptionKey: symmetric
        "02 0124 80 00 80 82" + "00" * 32,  # encryptionKey: public
        "c0 0124" + "00" * 8 + "02 07 80 04 01 112233",  # an addition: inlineP2pcdRequest
        "80 0124 02 04 f0 01aa 02bbbb 01cc 03dddddd",  # all four
    ],
)
def test_whatever_else_stands_in_the_header_the_payload_is_found(header):
    octets = signed(bytes.fromhex(header))
    assert unwrap(octets) == Unwrapped(PAYLOAD, 36, b"")
    assert_cut_anywhere_is_refused(octets)


@pytest.mark.parametrize(
    "region",
    [
        "80" + "00" * 10,  # circular
        "81 01 02" + "00" * 32,  # rectangular
        "82 01 03" + "00" * 24,  # polygonal
        "83 01 02 80 0114 80 0028",  # countries
        "83 01 01 81 0114 01 02 0102",  # a country and regions
        "83 01 01 82 0114 01 01 07 01 02 00010002",  # and their parts
    ],
)
def test_permissions_are_found_behind_every_kind_of_region(region):
    octets = signed(signer=certificate(CAM_MAY, bytes.fromhex(region)))
    assert unwrap(octets).ssp == bytes.fromhex("010203")
    assert_cut_anywhere_is_refused(octets)


@pytest.mark.parametrize("identity", ["83", "81 03 616263", "82 02 0102", "80 00" + "00" * 11, "80 80" + "00" * 24])
def test_permissions_are_found_behind_every_kind_of_identity(identity):
    assert unwrap(signed(signer=certificate(CAM_MAY, identity=bytes.fromhex(identity)))).ssp == bytes.fromhex("010203")


def test_a_certificate_may_hold_an_encryption_key_and_additions():
    key = b"\x00\x80\x83" + bytes(32)
    octets = signed(signer=certificate(CAM_MAY, encryption_key=key, version_2_additions=b"\x02\x04\x80\x01\x00"))
    assert unwrap(octets).ssp == bytes.fromhex("010203")
    assert_cut_anywhere_is_refused(octets)


@pytest.mark.parametrize(
    ("permissions", "ssp"),
    [
        ("", ""),  # no permissions at all
        ("0101 00 0124", ""),  # for the service, without an SSP
        ("0101 80 0125 80 02 aabb", ""),  # for another service
        ("0101 80 0124 80 02 aabb", "aabb"),  # opaque
        ("0101 80 0124 80 20" + "11" * 32, "11" * 32),
        ("0101 80 0124 80 21" + "11" * 33, ""),  # more than RxSecurity can hold
    ],
)
def test_the_ssp_is_that_of_the_service_or_empty(permissions, ssp):
    found = unwrap(signed(signer=certificate(bytes.fromhex(permissions))))
    assert found.ssp == bytes.fromhex(ssp)


@pytest.mark.parametrize(
    "signature",
    [
        b"\x81\x80" + bytes(64),  # Brainpool
        b"\x80\x84" + bytes(96),  # both coordinates
        b"\x80\x81" + bytes(32),  # fill
        b"\x82\x62\x80" + bytes(97),  # P-384, an addition
    ],
)
def test_every_kind_of_signature_is_walked_over(signature):
    octets = signed(signature=signature)
    assert unwrap(octets).payload == PAYLOAD
    assert_cut_anywhere_is_refused(octets)


@pytest.mark.parametrize("signer", [b"\x82", b"\x81\x01\x00"])
def test_a_packet_without_a_certificate_has_no_ssp(signer):
    assert unwrap(signed(signer=signer)).ssp == b""


def test_a_payload_of_more_than_127_octets_has_a_long_length():
    payload = b"\x40\x03\x80\x82\x01\x2c" + bytes(300)
    assert unwrap(signed(payload=payload)).payload == bytes(300)


# --- invalid packets ---


@pytest.mark.parametrize("name", SIGNED)
def test_a_captured_packet_cut_off_at_any_octet_is_refused(name):
    assert_cut_anywhere_is_refused(packet(name)[4:])


@pytest.mark.parametrize("start", ["", "03", "0280", "0380", "0382", "0383", "0281", "0381"])
def test_what_is_no_signed_data_of_version_3_is_refused(start):
    with pytest.raises(ProtocolError, match="security"):
        unwrap(bytes.fromhex(start))


def test_a_payload_that_is_elsewhere_is_refused():
    with pytest.raises(ProtocolError, match="hash"):
        unwrap(signed(payload=b"\x20\x80" + bytes(32)))


def test_signed_data_in_signed_data_is_refused():
    with pytest.raises(ProtocolError, match="alternative"):
        unwrap(signed(payload=b"\x40" + signed()))


def test_a_count_of_certificates_that_cannot_be_is_refused_at_once():
    with pytest.raises(ProtocolError, match="elements"):
        unwrap(signed(signer=b"\x81\x08" + b"\xff" * 8))


def test_a_length_of_a_length_that_cannot_be_is_refused():
    with pytest.raises(ProtocolError):
        unwrap(b"\x03\x81\x00\x40\x03\x80\xff" + b"\xff" * 60)


@given(octets=st.binary(max_size=200))
@settings(deadline=None, max_examples=500)
def test_random_octets_are_refused_or_unwrapped(octets):
    for start in (b"", b"\x03\x81", b"\x03\x81\x00\x40\x03\x80\x01\x00"):
        try:
            assert isinstance(unwrap(start + octets), Unwrapped)
        except ProtocolError as error:
            assert error.message


@given(name=st.sampled_from(SIGNED), place=st.integers(0, 400), octet=st.integers(0, 255))
@settings(deadline=None, max_examples=1000)
def test_a_wrong_octet_is_refused_or_unwrapped(name, place, octet):
    octets = bytearray(packet(name)[4:])
    octets[place % len(octets)] = octet
    try:
        assert len(unwrap(bytes(octets)).ssp) <= 32
    except ProtocolError as error:
        assert error.message
