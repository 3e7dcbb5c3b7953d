"""Which of two sockets the kernel gives a message to."""

import json
import socket
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.urgent import KEEP_OTHER, KEEP_URGENT, Program, by_frame, by_octet, by_port, keep

CAPTURES = json.loads((Path(__file__).parents[1] / "captures" / "frames.json").read_text())
FRAMES = {frame["name"]: bytes.fromhex(frame["hex"]) for frame in CAPTURES["frames"]}
CAM_PORT, DENM_PORT = bytes.fromhex("07d1"), bytes.fromhex("07d2")


class Pair:
    """Two sockets behind two filters, as the ethernet interface has them, but of AF_UNIX: no privilege needed."""

    def __init__(self, urgent: Program, other: Program) -> None:
        self.ends = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) for _ in range(2)]
        keep(self.ends[0][0], urgent)
        keep(self.ends[1][0], other)

    def kept(self, message: bytes) -> list[bool]:
        for _, far in self.ends:
            far.send(message)
        return [_received(near, message) for near, _ in self.ends]

    def close(self) -> None:
        for near, far in self.ends:
            near.close()
            far.close()


def _received(near: socket.socket, message: bytes) -> bool:
    try:
        assert near.recv(4096) == message
    except BlockingIOError:
        return False
    return True


PROGRAMS = {
    "pdu": (by_octet({1}, KEEP_URGENT), by_octet({1}, KEEP_OTHER)),
    "btp": (by_port({2002}, KEEP_URGENT), by_port({2002}, KEEP_OTHER)),
    "ethernet": (by_frame({2002}, KEEP_URGENT), by_frame({2002}, KEEP_OTHER)),
}


@pytest.fixture(params=PROGRAMS)
def pair(request):
    pair = Pair(*PROGRAMS[request.param])
    yield pair
    pair.close()


@pytest.fixture
def frames():
    pair = Pair(*PROGRAMS["ethernet"])
    yield pair
    pair.close()


URGENT, OTHER = [True, False], [False, True]


@given(message=st.binary(min_size=1, max_size=200) | st.sampled_from(list(FRAMES.values())))
def test_every_message_is_kept_by_exactly_one_of_the_two(pair, message):
    assert sum(pair.kept(message)) == 1


@pytest.mark.parametrize("name", [name for name in FRAMES if "cam" in name])
def test_a_truncated_frame_is_kept_by_exactly_one_wherever_it_ends(frames, name):
    frame = FRAMES[name].replace(CAM_PORT, DENM_PORT, 1)
    assert all(sum(frames.kept(frame[:end])) == 1 for end in range(1, len(frame)))


@pytest.mark.parametrize("name", list(FRAMES))
def test_frames_of_another_station_that_are_not_denms_are_not_urgent(frames, name):
    assert frames.kept(FRAMES[name]) == OTHER


@pytest.mark.parametrize("name", [name for name in FRAMES if "cam" in name])
def test_the_same_frames_with_the_port_of_a_denm_are_urgent_signed_or_not(frames, name):
    frame = FRAMES[name]
    assert CAM_PORT in frame
    assert frames.kept(frame.replace(CAM_PORT, DENM_PORT, 1)) == URGENT


def _signed(payload: bytes) -> bytes:
    """A signed frame's beginning around another payload; COER length as long as it must be."""
    size = len(payload)
    length = bytes([size]) if size < 128 else bytes([0x82, size >> 8, size & 255])
    frame = FRAMES["cam-signed-digest"]
    return frame[:14] + b"\x12" + frame[15:18] + bytes.fromhex("038100400380") + length + payload


@pytest.mark.parametrize("size", [60, 127, 128, 300, 1400])
def test_the_length_of_a_signed_payload_does_not_matter(frames, size):
    payload = FRAMES["cam-shb"][18:].replace(CAM_PORT, DENM_PORT, 1)
    assert frames.kept(_signed(payload.ljust(size, b"\0"))) == URGENT


# Header type and octets of its extended header (EN 302 636-4-1 V1.4.1, clause 9.8).
@pytest.mark.parametrize(
    ("header_type", "octets"), [(0x50, 28), (0x51, 28), (0x40, 44), (0x42, 44), (0x30, 44), (0x20, 48)]
)
def test_the_port_is_found_behind_every_header_that_carries_one(frames, header_type, octets):
    start = bytearray(FRAMES["cam-shb"][:26])
    start[19] = header_type
    assert frames.kept(bytes(start) + bytes(octets) + DENM_PORT + bytes(40)) == URGENT
    assert frames.kept(bytes(start) + bytes(octets) + CAM_PORT + bytes(40)) == OTHER
    assert frames.kept(bytes(start) + bytes(octets + 1) + DENM_PORT + bytes(40)) == OTHER


@pytest.mark.parametrize("header_type", [0x00, 0x10, 0x60, 0x61, 0x70, 0xF0])
def test_a_beacon_a_location_query_or_an_unknown_header_is_never_urgent(frames, header_type):
    frame = bytearray(FRAMES["cam-shb"])
    frame[19] = header_type
    assert frames.kept(bytes(frame).replace(CAM_PORT, DENM_PORT, 1)) == OTHER


def test_another_ethertype_is_never_urgent(frames):
    frame = bytearray(FRAMES["cam-shb"].replace(CAM_PORT, DENM_PORT, 1))
    frame[13] = 0x48
    assert frames.kept(bytes(frame)) == OTHER


def test_a_bare_pdu_is_urgent_by_its_message_id():
    pair = Pair(*PROGRAMS["pdu"])
    assert [pair.kept(bytes([2, number, 0, 0])) for number in (1, 2, 14)] == [URGENT, OTHER, OTHER]
    assert pair.kept(b"\x01") == OTHER
    pair.close()


def test_a_btp_packet_is_urgent_by_its_port():
    pair = Pair(*PROGRAMS["btp"])
    assert [pair.kept(port + bytes(8)) for port in (DENM_PORT, CAM_PORT)] == [URGENT, OTHER]
    assert pair.kept(b"\x07") == OTHER
    pair.close()


def test_many_urgent_ports_are_all_found():
    ports = set(range(3000, 3300))
    pair = Pair(by_frame(ports, KEEP_URGENT), by_frame(ports, KEEP_OTHER))
    frame = FRAMES["cam-shb"]
    assert all(pair.kept(frame.replace(CAM_PORT, port.to_bytes(2), 1)) == URGENT for port in (3000, 3150, 3299))
    assert pair.kept(frame) == OTHER
    pair.close()
