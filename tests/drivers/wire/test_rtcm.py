"""RTCM 3 frames compared with pyrtcm."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyrtcm import RTCMReader, calc_crc24q

from board.runtime.errors import ProtocolError
from drivers.wire import rtcm

# Example of the framing in RTCM 10403.3, clause 4.2: a message 1005 of station 2003.
EXAMPLE = bytes.fromhex("d300133ed7d30202980edeef34b4bd62ac0941986f33360b98")


def test_the_example_of_the_standard_is_built_and_taken_apart():
    frame = rtcm.RtcmFrame(EXAMPLE)
    assert frame.number == 1005
    assert rtcm.encode(frame.message) == EXAMPLE
    assert rtcm.crc24q(EXAMPLE) == 0
    assert RTCMReader.parse(EXAMPLE).DF003 == 2003


@given(message=st.binary(max_size=1023))
def test_the_checksum_is_theirs(message):
    frame = rtcm.encode(message)
    assert calc_crc24q(frame[:-3]).to_bytes(3, "big") == frame[-3:]


@given(message=st.binary(min_size=2, max_size=1023))
def test_a_message_has_its_number_in_its_first_twelve_bits(message):
    assert rtcm.RtcmFrame(rtcm.encode(message)).number == int.from_bytes(message[:2]) >> 4


def test_a_message_that_is_too_long_is_refused():
    with pytest.raises(ProtocolError, match="1024 octets"):
        rtcm.encode(bytes(1024))


def test_an_empty_message_has_no_number():
    assert rtcm.RtcmFrame(rtcm.encode(b"")).number is None


@given(at=st.integers(0, len(EXAMPLE) * 8 - 1))
def test_every_bit_of_a_frame_is_covered(at):
    damaged = bytearray(EXAMPLE)
    damaged[at // 8] ^= 1 << at % 8
    assert rtcm.crc24q(damaged)
