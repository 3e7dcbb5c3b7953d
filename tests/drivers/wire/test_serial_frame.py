"""Frames of a serial line: whole, cut, damaged and among garbage."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import RequestError
from drivers.reason import Reason
from drivers.wire.garbage import SAMPLE, Garbage
from drivers.wire.serial_frame import GAP_S, OVERHEAD, Frame, SerialFrames, encode

CAM = bytes.fromhex("0202000005390001020304")

frames = st.builds(Frame, st.integers(0, 65535), st.binary(max_size=1500))
# Garbage with octets that may look like the beginning of a frame.
noise = st.lists(
    st.sampled_from([b"V", b"2", b"V2", b"V2\0\x0a", b"V2\xff", b"\0", b"x" * 40]) | st.binary(), max_size=12
)


def octets_of(events):
    return sum(OVERHEAD + len(event.pdu) if isinstance(event, Frame) else event.octets for event in events)


def received(core, octets, now=0.0):
    events = core.receive(octets, now)
    return events + core.expire(now + 1)


def test_a_frame_has_the_octets_that_the_description_says():
    assert encode(2001, CAM) == b"V2" + bytes.fromhex("000d 07d1") + CAM + bytes.fromhex("60ef3888")


@given(frame=frames)
def test_what_was_encoded_is_received(frame):
    assert SerialFrames().receive(encode(*frame), 0.0) == [frame]


@given(sent=st.lists(frames, max_size=5), cuts=st.lists(st.integers(1, 700)))
def test_frames_do_not_depend_on_how_their_octets_arrive(sent, cuts):
    octets, core, events = b"".join(encode(*frame) for frame in sent), SerialFrames(), []
    for cut in [*cuts, len(octets)]:
        events += core.receive(octets[:cut], 0.0)
        octets = octets[cut:]
    assert events == sent


@given(before=noise, frame=frames, after=noise)
def test_a_frame_among_garbage_is_found_and_no_octet_is_uncounted(before, frame, after):
    octets = b"".join([*before, encode(*frame), *after])
    events = received(SerialFrames(), octets)
    assert frame in events
    assert octets_of(events) == len(octets)


@given(frame=frames, place=st.integers(0), bit=st.integers(0, 7))
def test_one_wrong_bit_is_noticed_and_the_next_frame_passes(frame, place, bit):
    damaged = bytearray(encode(*frame))
    damaged[place % len(damaged)] ^= 1 << bit
    core = SerialFrames()
    events = received(core, bytes(damaged))
    assert [event for event in events if isinstance(event, Frame)] == []
    assert octets_of(events) == len(damaged)
    assert core.receive(encode(*frame), 2.0) == [frame]


@given(octets=st.lists(st.binary(max_size=3000), max_size=5))
def test_random_octets_are_counted_and_leave_the_receiver_able(octets):
    core, events = SerialFrames(), []
    for now, part in enumerate(octets):
        events += core.receive(part, float(now))
    events += core.expire(1e6)
    assert octets_of(events) == sum(map(len, octets))
    assert all(len(event.sample) <= SAMPLE for event in events if isinstance(event, Garbage))
    assert core.deadline() is None
    assert core.receive(encode(7, CAM), 2e6) == [Frame(7, CAM)]


def test_a_damaged_frame_is_told_once_as_a_wrong_checksum():
    damaged = encode(2001, CAM)[:-1] + b"\0"
    events = SerialFrames().receive(damaged + encode(2001, CAM), 0.0)
    assert events == [Garbage(Reason.CHECKSUM, damaged, len(damaged)), Frame(2001, CAM)]


@pytest.mark.parametrize("length", [0, 1, 1503, 65535])
def test_an_impossible_length_is_a_framing_error(length):
    garbage = b"V2" + length.to_bytes(2) + bytes(30)
    assert received(SerialFrames(), garbage) == [Garbage(Reason.FRAMING, garbage, len(garbage))]


def test_an_unfinished_frame_is_waited_for_as_long_as_octets_come():
    core, octets = SerialFrames(), encode(2001, CAM)
    for place in range(len(octets) - 1):
        assert core.receive(octets[place : place + 1], place * GAP_S) == []
        assert core.expire(core.deadline() - 0.001) == []
    assert core.receive(octets[-1:], 99.0) == [Frame(2001, CAM)]


def test_a_beginning_that_was_cut_off_does_not_swallow_the_frame_behind_it():
    core, cut = SerialFrames(), encode(2001, bytes(1000))[:100]
    assert core.receive(cut + encode(2002, CAM), 0.0) == []
    first, frame = core.expire(GAP_S)
    assert first == Garbage(Reason.FRAMING, cut[:SAMPLE], 100)
    assert frame == Frame(2002, CAM)


def test_endless_garbage_is_told_while_it_comes_and_kept_short():
    core = SerialFrames()
    events = [event for now in range(100) for event in core.receive(bytes(1000), now * 0.01)]
    assert len(events) > 10
    assert len(core._waiting) < 10


def test_a_pdu_that_is_too_long_is_refused():
    with pytest.raises(RequestError, match="1501"):
        encode(2001, bytes(1501))
