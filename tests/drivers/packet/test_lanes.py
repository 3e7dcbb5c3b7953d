"""Lanes: the kernel gives each message to the socket of its type."""

import json
import socket
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.address import Address
from drivers.packet.lanes import ALL, NONE, in_btp, in_frame, in_packet, in_pdu, keep
from drivers.udp.sockets import open_unicast

CAPTURES = json.loads((Path(__file__).parents[2] / "captures" / "frames.json").read_text())
FRAMES = {frame["name"]: bytes.fromhex(frame["hex"]) for frame in CAPTURES["frames"]}
CAM_START = bytes.fromhex("07d100000202")  # BTP port, its info, version and messageID of the PDU
CAMS = [name for name, frame in FRAMES.items() if CAM_START in frame]

LANES = (frozenset({1}), frozenset({2}), frozenset({4, 5}), frozenset({16, 102}))
DENM_LANE, CAM_LANE, SPATEM_LANE, VAM_LANE, LAST = range(5)


class Group:
    """Group of sockets at one port, with a BPF program that chooses among them."""

    def __init__(self, program, count=5):
        self.sockets = open_unicast(Address("127.0.0.1", 0), count, program)
        self._sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._sender.connect(self.sockets[0].getsockname())

    def lane(self, message):
        """Return the index of the socket that receives a message; only one may."""
        self._sender.send(message)
        (place,) = [place for place, one in enumerate(self.sockets) if _received(one, message)]
        return place

    def close(self):
        for one in (*self.sockets, self._sender):
            one.close()


def _received(one, message):
    try:
        assert one.recv(4096) == message
    except BlockingIOError:
        return False
    return True


def group(program):
    opened = Group(program)
    yield opened
    opened.close()


PROGRAMS = {"pdu": in_pdu, "btp": in_btp, "ethernet": in_frame, "raw": in_packet}


@pytest.fixture(params=PROGRAMS)
def any_framing(request):
    yield from group(PROGRAMS[request.param](LANES))


@pytest.fixture
def frames():
    yield from group(in_frame(LANES))


@pytest.fixture
def packets():
    yield from group(in_packet(LANES))


def with_message(frame, number):
    """Return the frame with another messageID."""
    at = frame.index(CAM_START) + 5
    return frame[:at] + bytes([number]) + frame[at + 1 :]


BY_NUMBER = [(1, 0), (2, 1), (4, 2), (5, 2), (16, 3), (102, 3), (0, 4), (3, 4), (77, 4), (255, 4)]


@given(message=st.binary(max_size=200) | st.sampled_from(list(FRAMES.values())))
def test_every_message_is_in_exactly_one_lane(any_framing, message):
    any_framing.lane(message)


@pytest.mark.parametrize(("number", "lane"), BY_NUMBER)
def test_a_bare_pdu_goes_by_its_message_id(number, lane):
    for group_of_one in group(in_pdu(LANES)):
        assert group_of_one.lane(bytes([2, number])) == lane
        assert group_of_one.lane(bytes([number])) == LAST
        assert group_of_one.lane(b"") == LAST


@pytest.mark.parametrize(("number", "lane"), BY_NUMBER)
def test_a_btp_packet_goes_by_the_message_id_behind_its_header(number, lane):
    for group_of_one in group(in_btp(LANES)):
        whole = bytes([7, 0xD1, 0, 0, 2, number])
        assert group_of_one.lane(whole) == lane
        assert [group_of_one.lane(whole[:end]) for end in range(6)] == [LAST] * 6


@pytest.mark.parametrize("name", CAMS)
@pytest.mark.parametrize(("number", "lane"), BY_NUMBER)
def test_a_frame_goes_by_the_message_id_whether_signed_or_not(frames, packets, name, number, lane):
    frame = with_message(FRAMES[name], number)
    assert frames.lane(frame) == lane
    assert packets.lane(frame[14:]) == lane


@pytest.mark.parametrize("name", [name for name in FRAMES if name not in CAMS])
def test_real_frames_that_are_no_cams_are_neither_in_their_lane_nor_urgent(frames, packets, name):
    assert frames.lane(FRAMES[name]) not in (DENM_LANE, CAM_LANE)
    assert packets.lane(FRAMES[name][14:]) not in (DENM_LANE, CAM_LANE)


@pytest.mark.parametrize("name", CAMS)
@pytest.mark.parametrize("number", [1, 16])
def test_a_frame_that_ends_before_its_message_id_is_in_the_last_lane(frames, packets, name, number):
    frame = with_message(FRAMES[name], number)
    known = frame.index(CAM_START[:5]) + 6
    right = frames.lane(frame)
    assert right != LAST
    assert [frames.lane(frame[:end]) for end in range(known)] == [LAST] * known
    assert [packets.lane(frame[14:end]) for end in range(14, known)] == [LAST] * (known - 14)
    assert {frames.lane(frame[:end]) for end in range(known, len(frame))} == {right}
    assert {packets.lane(frame[14:end]) for end in range(known, len(frame))} == {right}


def _signed(payload):
    """Return the beginning of a signed frame around another payload, with the shortest COER length."""
    size = len(payload)
    length = bytes([size]) if size < 128 else bytes([0x82, size >> 8, size & 255])
    frame = FRAMES["cam-signed-digest"]
    return frame[:14] + b"\x12" + frame[15:18] + bytes.fromhex("038100400380") + length + payload


def test_an_envelope_of_version_2_is_in_the_last_lane(frames, packets):
    frame = _signed(with_message(FRAMES["cam-shb"], 1)[18:])
    assert frames.lane(frame) == DENM_LANE
    old = frame[:18] + b"\x02" + frame[19:]
    assert (frames.lane(old), packets.lane(old[14:])) == (LAST, LAST)


@pytest.mark.parametrize("size", [60, 127, 128, 300, 1400])
def test_the_length_of_a_signed_payload_does_not_matter(frames, size):
    payload = with_message(FRAMES["cam-shb"], 4)[18:]
    assert frames.lane(_signed(payload.ljust(size, b"\0"))) == SPATEM_LANE


# Header type and octets of its extended header (EN 302 636-4-1 V1.4.1, clause 9.8).
@pytest.mark.parametrize(
    ("header_type", "octets"), [(0x50, 28), (0x51, 28), (0x40, 44), (0x42, 44), (0x30, 44), (0x20, 48)]
)
def test_the_message_is_found_behind_every_header_that_carries_one(frames, header_type, octets):
    start = bytearray(FRAMES["cam-shb"][:26])
    start[19] = header_type
    for number, lane in BY_NUMBER:
        message = bytes([7, 0xD1, 0, 0, 77, number])
        assert frames.lane(bytes(start) + bytes(octets) + message) == lane
        assert frames.lane(bytes(start) + bytes(octets + 1) + message) == LAST


@pytest.mark.parametrize("header_type", [0x00, 0x10, 0x60, 0x61, 0x70, 0xF0])
def test_a_beacon_a_location_query_or_an_unknown_header_is_in_the_last_lane(frames, header_type):
    frame = bytearray(FRAMES["cam-shb"])
    frame[19] = header_type
    assert frames.lane(bytes(frame)) == LAST


def test_another_ethertype_is_in_the_last_lane(frames):
    frame = bytearray(FRAMES["cam-shb"])
    frame[13] = 0x48
    assert frames.lane(bytes(frame)) == LAST


def test_as_many_types_as_there_can_be_are_all_found():
    lanes = [frozenset({number, number + 128}) for number in range(63)]
    many = Group(in_frame(lanes), 64)
    frame = FRAMES["cam-shb"]
    assert [many.lane(with_message(frame, number)) for number in (0, 62, 128, 190, 63, 255)] == [0, 62, 0, 62, 63, 63]
    many.close()


def test_without_lanes_everything_is_in_the_last():
    one = Group(in_pdu(()), 1)
    assert one.lane(bytes([2, 1])) == 0
    one.close()


def test_a_filter_takes_the_place_of_the_one_before():
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
    keep(near, NONE)
    far.send(b"1")
    keep(near, ALL)
    far.send(b"2")
    assert near.recv(10) == b"2"
    near.close()
    far.close()
