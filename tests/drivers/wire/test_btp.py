"""BTP-B headers."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from drivers.wire.btp import BtpB, decode_b, encode

PORT = st.integers(0, 65535)


def test_a_btp_b_header_is_the_port_and_its_info():
    assert encode(BtpB(2001), b"pdu") == bytes.fromhex("07d10000") + b"pdu"
    assert decode_b(bytes.fromhex("07d20017") + b"pdu") == (BtpB(2002, 23), b"pdu")


@pytest.mark.parametrize("octets", [0, 1, 2, 3])
def test_a_packet_shorter_than_its_header_is_refused(octets):
    with pytest.raises(ProtocolError, match=f"truncated header: {octets} of"):
        decode_b(bytes(octets))


@given(first=PORT, second=PORT, pdu=st.binary(max_size=50))
@settings(deadline=None, max_examples=100)
def test_a_packet_survives_the_way_to_octets_and_back(first, second, pdu):
    assert decode_b(encode(BtpB(first, second), pdu)) == (BtpB(first, second), pdu)


@given(octets=st.binary(max_size=10))
@settings(deadline=None, max_examples=100)
def test_random_octets_are_refused_or_decoded(octets):
    if len(octets) < 4:
        with pytest.raises(ProtocolError):
            decode_b(octets)
    else:
        header, pdu = decode_b(octets)
        assert encode(header, pdu) == octets
