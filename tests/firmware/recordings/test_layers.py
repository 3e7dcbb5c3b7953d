import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import ProtocolError
from firmware.recordings.layers import Carried, NoMessage, link_of, open_frame, open_packet

CAPTURES = Path(__file__).parents[2] / "captures" / "frames.json"
FRAMES = {row["name"]: bytes.fromhex(row["hex"]) for row in json.loads(CAPTURES.read_text())["frames"]}
CAM = FRAMES["cam-shb"]
PACKET = CAM[14:]


def carried(link: int, frame: bytes) -> Carried:
    found = open_frame(link, frame)
    assert isinstance(found, Carried)
    return found


@pytest.mark.parametrize("name", [name for name in FRAMES if "hello" not in name])
def test_every_frame_of_an_independent_station_gives_its_cam(name):
    found = carried(1, FRAMES[name])
    assert found.pdu[:2] == b"\x02\x02"
    assert len(found.pdu) == 41
    assert (found.btp_port, found.transport, found.is_signed) == (2001, "shb", "signed" in name)


def test_what_carried_a_message_is_told_in_words():
    assert str(carried(1, FRAMES["cam-signed-digest"])) == "signed shb, BTP port 2001"


def wlan(first: int, second: int, address_octets: int) -> bytes:
    return bytes((first, second)) + bytes(22 + address_octets) + bytes.fromhex("aaaa030000008947") + PACKET


UDP = bytes(8) + FRAMES["udp-payload"]
IPV4 = b"\x46" + bytes(8) + b"\x11" + bytes(14) + UDP  # one option
IPV6 = b"\x60" + bytes(5) + b"\x11" + bytes(33) + UDP


@pytest.mark.parametrize(
    ("link", "frame"),
    [
        (1, bytes(12) + b"\x08\x00" + IPV4),
        (1, bytes(12) + b"\x86\xdd" + IPV6),
        (113, bytes(14) + b"\x08\x00" + IPV4),
    ],
)
def test_a_frame_in_a_datagram_is_opened(link, frame):
    assert carried(link, frame) == carried(1, FRAMES["udp-payload"])


@pytest.mark.parametrize("size", range(13, 36))
def test_datagrams_that_were_cut_off_carry_nothing(size):
    frame = bytes(12) + b"\x08\x00" + IPV4
    assert open_frame(1, frame[:size]) == NoMessage("not GeoNetworking")


@pytest.mark.parametrize(
    ("link", "frame"),
    [
        (1, CAM[:12] + b"\x81\x00\x60\x01" + CAM[12:]),
        (105, wlan(0x08, 0x00, 0)),
        (105, wlan(0x88, 0x00, 2)),  # QoS
        (105, wlan(0x08, 0x03, 6)),  # four addresses
        (127, b"\0\0\x0a\0" + bytes(6) + wlan(0x88, 0x00, 2)),
        (113, bytes(14) + CAM[12:]),
        (276, b"\x89\x47" + bytes(18) + PACKET),
    ],
)
def test_link_layers_that_capture_its_g5_are_opened(link, frame):
    assert carried(link, frame) == carried(1, CAM)


@pytest.mark.parametrize(
    ("link", "frame", "what"),
    [
        (1, bytes(60), "not GeoNetworking"),
        (1, b"", "not GeoNetworking"),
        (105, b"\x80\0" + bytes(40), "not GeoNetworking"),
        (105, wlan(0x08, 0x40, 0), "not GeoNetworking"),
        (127, b"\0\0\xff\xff", "not GeoNetworking"),
        (147, CAM, "with unsupported link type 147"),
    ],
)
def test_frames_of_others_are_told_by_what_they_are(link, frame, what):
    assert open_frame(link, frame) == NoMessage(what)


def test_a_beacon_has_no_message():
    beacon = bytes.fromhex("11001a01 00100000 00000100") + PACKET[12:36]
    assert open_packet(beacon) == NoMessage("beacons")


def test_ip_over_geonetworking_is_no_message():
    packet = bytearray(PACKET)
    packet[4] = 0x30
    assert open_packet(bytes(packet)) == NoMessage("GeoNetworking with next header 3, not BTP")


@pytest.mark.parametrize("size", [1, 4, 12, 39, 41, 80])
def test_a_packet_that_was_cut_off_is_refused(size):
    with pytest.raises(ProtocolError):
        open_packet(PACKET[:size])


@pytest.mark.parametrize("name", FRAMES)
def test_a_frame_is_known_by_its_ethertype(name):
    assert link_of(FRAMES[name]) == 1
    assert link_of(FRAMES[name][14:]) is None


@pytest.mark.parametrize(
    ("link", "frame"),
    [
        (105, wlan(0x88, 0x00, 2)),
        (113, b"\0\4" + bytes(12) + CAM[12:]),
        (127, b"\0\0\x08\0" + bytes(4) + wlan(0x08, 0x00, 0)),
        (127, b"\0\0\x10\0" + b"\0\0\0\x80\0\0\0\x80\0\0\0\0" + wlan(0x08, 0x00, 0)),  # three bitmaps
        (127, b"\0\0\x08\0" + bytes(4) + b"\xd4" + bytes(9)),  # an acknowledgement
        (276, b"\x89\x47" + bytes(18) + PACKET),
    ],
)
def test_a_link_layer_is_known_by_its_first_octets(link, frame):
    assert link_of(frame) == link


@pytest.mark.parametrize(
    "octets",
    [
        b"",
        b"\0\0",
        b"\0\0\x08\0" + bytes(4),  # nothing behind radiotap
        b"\0\0\x07\0" + bytes(20),  # shorter than its own header
        b"\0\0\x08\0\0\0\0\x80" + bytes(20),  # a second bitmap beyond its end
        b"\0\1\x08\0" + bytes(20),
        b"\0\0\x08\0" + bytes(4) + b"\x01" + bytes(20),  # 802.11 of another version
        b"\x02\x02" + wlan(0x08, 0x00, 0)[2:],
        b"\2\2" + bytes(12) + CAM[12:],
    ],
)
def test_octets_that_begin_like_no_link_layer_are_no_frame(octets):
    assert link_of(octets) is None


@given(st.binary(max_size=120))
def test_random_octets_have_a_link_layer_that_opens_them_or_none(octets):
    link = link_of(octets)
    if link is not None:
        try:
            assert isinstance(open_frame(link, octets), Carried | NoMessage)
        except ProtocolError as error:
            assert error.message


@given(st.sampled_from([1, 105, 113, 127, 276]), st.binary(max_size=120))
def test_random_frames_are_taken_or_explained(link, frame):
    try:
        assert isinstance(open_frame(link, frame), Carried | NoMessage)
    except ProtocolError as error:
        assert error.message


@given(st.integers(0, len(PACKET) - 1), st.integers(0, 255))
def test_packets_with_one_wrong_octet_are_taken_or_explained(at, octet):
    packet = PACKET[:at] + bytes((octet,)) + PACKET[at + 1 :]
    try:
        assert isinstance(open_packet(packet), Carried | NoMessage)
    except ProtocolError as error:
        assert error.message
