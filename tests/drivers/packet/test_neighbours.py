"""Simulated neighbours, heard by a real interface."""

import shutil
import socket
import struct
import subprocess

import pytest

from board.runtime.describe import read
from board.runtime.errors import ConfigurationError, InterfaceError
from board.runtime.free_udp import free_udp
from drivers.sim.messages import TRACE, cam, denm
from drivers.sim.neighbours import Neighbours
from drivers.sim.options import NeighboursOptions
from drivers.sim.track import Motion
from drivers.udp.driver import Udp, UdpOptions
from drivers.wire import frame
from tests.drivers.host import CAM, DENM, MAC, SHARED, request

PATIENCE_S = 0.0  # nothing here crosses the kernel's threads
NOON = 1_795_176_000.0  # 2026-11-20T12:00:00Z
HERE = Motion(487668616, 114320680, 420_000, 13_890, 9_000_000, -0.005)
PATH = [HERE] * (TRACE + 1)


@pytest.fixture
def begin(loop, host, at_end):
    """Return a function that starts a station and simulated neighbours that know each other's addresses."""

    def begin(wall=lambda: NOON, **options):
        (listen,) = map(str, free_udp("127.0.0.1", 1))
        driver = Udp(UdpOptions(listen="127.0.0.1:0", peers=(listen,), beacon_s=0.0), SHARED)
        driver.start(host)
        neighbours = Neighbours(loop, NeighboursOptions(listen=listen, to=str(driver.address), **options), wall)
        neighbours.start()
        at_end(driver.stop)
        at_end(neighbours.stop)
        return driver, neighbours

    return begin


def test_each_sends_ten_cams_and_one_denm_a_second(loop, host, begin):
    _, neighbours = begin(count=3)
    loop.run_for(9.99)
    assert neighbours.sent == {2: 300, 1: 30}
    assert host.count == 330
    assert host.drops == {}
    macs = {rx.source_mac for _, _, rx in host.indications}
    stations = {pdu[2:6] for pdu in host.pdus}
    assert (len(macs), stations) == (3, {number.to_bytes(4) for number in (4711, 4712, 4713)})


def test_their_denms_are_geobroadcasts_to_an_area_around_them_each_an_event_of_its_own(loop, host, begin):
    begin(count=1, cam_hz=10.0, denm_hz=1.0)
    loop.run_for(3.95)
    denms = [(pdu, rx) for pdu, _, rx in host.indications if pdu[1] == 1]
    sequences = [int.from_bytes(pdu) >> (len(pdu) * 8 - 105) & 0xFFFF for pdu, _ in denms]
    assert sequences == [1, 2, 3, 4]
    assert {(rx.transport, rx.traffic_class, rx.area.centre == rx.position) for _, rx in denms} == {("gbc", 1, True)}
    assert {(rx.transport, rx.traffic_class) for pdu, _, rx in host.indications if pdu[1] == 2} == {("shb", 2)}


@pytest.mark.parametrize("utc_s", [0.0, -1.0, 1_072_915_199.0, 5_471_000_000.0, 9_223_372_036.0])
def test_a_clock_that_was_never_set_or_is_beyond_2143_is_taken_for_the_nearest_its_time(loop, host, begin, utc_s):
    _, neighbours = begin(wall=lambda: utc_s)
    loop.run_for(1.99)
    assert neighbours.sent[2] > 30
    assert host.count == neighbours.sent.total()


def test_they_move_and_their_two_positions_agree(loop, host, begin):
    begin(count=1, denm_hz=0)
    loop.run_for(125)  # one lap
    places = [rx.position for _, _, rx in host.indications]
    assert len(set(places)) == len(places)
    north = [place.latitude for place in places]
    assert 35_900 < max(north) - min(north) < 36_000  # 400 m
    latitude = int.from_bytes(host.pdus[-1]) >> (46 * 8 - 107) & 0x7FFFFFFF
    assert latitude == places[-1].latitude + 900_000_000


def test_they_count_what_they_hear(loop, begin):
    driver, neighbours = begin()
    for pdu in (CAM, CAM, DENM):
        driver.send(request(pdu))
    loop.run_until(lambda: neighbours.heard.total() == 3)
    assert neighbours.heard == {2: 2, 1: 1}
    assert neighbours.missed == 0


@pytest.mark.parametrize("octets", [b"", b"noise", bytes(100), frame.wrap(MAC, b"\x11\x00")])
def test_noise_is_counted_and_harms_nobody(loop, begin, octets):
    _, neighbours = begin()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        host, port = neighbours.address.split(":")
        other.sendto(octets, (host, int(port)))
    loop.run_until(lambda: neighbours.missed == 1)
    loop.run_for(1)
    assert neighbours.heard == {}


def test_stopped_ones_are_silent_and_may_be_stopped_again(loop, host, begin):
    _, neighbours = begin()
    loop.run_for(1)
    neighbours.stop()
    neighbours.stop()
    loop.run_for(0.1)
    before = host.count
    loop.run_for(10)
    assert host.count == before > 0


def test_a_loop_that_was_busy_is_not_flooded_afterwards(loop, begin):
    _, neighbours = begin(count=1, denm_hz=0)
    loop.run_for(1.05)
    before = neighbours.sent[2]
    loop.now += 60
    loop.run_for(1)
    assert neighbours.sent[2] - before <= 12


def test_an_address_that_is_taken_is_said(loop, begin):
    _, neighbours = begin()
    with pytest.raises(InterfaceError, match="simulated neighbours at"):
        Neighbours(loop, NeighboursOptions(listen=neighbours.address)).start()


@pytest.mark.parametrize(
    "table", [{"listen": "x"}, {"to": "127.0.0.1"}, {"to": "127.0.0.1:70000"}, {"count": 0}, {"cam_hz": 0.0}]
)
def test_options_that_cannot_be_meant_are_refused(table):
    with pytest.raises(ConfigurationError):
        read(NeighboursOptions, table, "sim.toml")


def _dissected(tmp_path, pdu, port):
    """Return tshark's lines for a PDU, with the field names of Wireshark 4.0 (4.4 has stationId)."""
    header = bytes.fromhex("11001a01 20500280") + struct.pack(">HBB", len(pdu) + 4, 1, 0) + bytes(28)
    octets = frame.wrap(MAC, header + struct.pack(">HH", port, 0) + pdu)
    capture = tmp_path / "one.pcap"
    length = struct.pack("<II", len(octets), len(octets))
    capture.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1) + bytes(8) + length + octets)
    tshark = shutil.which("tshark")
    assert tshark is not None
    command = [tshark, "-r", str(capture), "-V", "-O", "its"]
    run = subprocess.run(command, check=True, capture_output=True, text=True, env={"TZ": "UTC", "HOME": str(tmp_path)})
    assert "Malformed" not in run.stdout
    return [line.strip().replace("tationId: ", "tationID: ") for line in run.stdout.splitlines()]


def test_the_changed_fields_of_a_cam_are_where_tshark_sees_them(tmp_path):
    lines = _dissected(tmp_path, cam(4711, 722_000_012_345, HERE), 2001)
    assert {"stationID: 4711", f"generationDeltaTime: {722_000_012_345 % 65536}"} <= set(lines)
    assert [line for line in lines if line.startswith("latitude: ") and "(487668616)" in line]
    assert [line for line in lines if line.startswith("longitude: ") and "(114320680)" in line]
    numbers = {"headingValue": 900, "speedValue": 1389, "curvatureValue": -50, "yawRateValue": -398}
    numbers |= {"altitudeValue": 42_000, "lateralAccelerationValue": -10}
    for name, value in numbers.items():
        assert [line for line in lines if line.startswith(f"{name}: ") and f"{value}" in line], name


def test_the_changed_fields_of_a_denm_are_where_tshark_sees_them(tmp_path):
    lines = _dissected(tmp_path, denm(4711, 722_000_012_345, PATH, 77), 2002)
    wanted = {"stationID: 4711", "originatingStationID: 4711", "sequenceNumber: 77"}
    assert wanted <= set(lines)
    assert [line for line in lines if line.startswith("detectionTime: ") and "(722000012345)" in line]
    assert [line for line in lines if line.startswith("referenceTime: ") and "(722000012345)" in line]
    assert [line for line in lines if line.startswith("latitude: ") and "(487668616)" in line]
    assert [line for line in lines if line.startswith("longitude: ") and "(114320680)" in line]


def test_only_the_named_fields_of_the_real_messages_are_changed():
    west, east = (
        Motion(-900_000_000, -1_800_000_000, -1_000_000, 0, 0),
        Motion(900_000_000, 1_800_000_000, 8_000_000, 0, 0),
    )
    ones, others = ([one] * (TRACE + 1) for one in (west, east))
    one = denm(1, 1, ones, 1)
    assert one == denm(1, 1, ones, 1)
    assert denm(2**32 - 1, 2**42 - 1, others, 65535)[39:] == one[39:]
    assert denm(1, 1, [west, *[east] * TRACE], 1)[398:] == one[398:]
    assert cam(2**32 - 1, 65535, east)[25:] == cam(0, 0, west)[25:]
