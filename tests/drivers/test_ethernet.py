"""Raw sockets on a veth pair, in a network namespace for each test."""

import errno
import json
import os
import socket
from pathlib import Path

import pytest

from board.netlink import device
from board.runtime.describe import read
from board.runtime.errors import ConfigurationError, InterfaceError, RequestError
from drivers.contract import Sent
from drivers.ethernet import Ethernet, EthernetOptions
from drivers.message import Area, Position, Shape
from drivers.reason import Reason
from drivers.wire.geonet.header import Address
from drivers.wire.geonet.packet import parse
from firmware.topics import Topics
from tests.drivers.benches import ip, wait_for_carrier
from tests.drivers.host import CAM, DENM, EGO, MAC, SHARED, Host, request, told

CAPTURES = json.loads((Path(__file__).parents[1] / "captures" / "frames.json").read_text())
FRAMES = {frame["name"]: bytes.fromhex(frame["hex"]) for frame in CAPTURES["frames"]}
CAM_FRAME = FRAMES["cam-shb"]
DENM_FRAME = CAM_FRAME[:54] + bytes.fromhex("07d200000201") + CAM_FRAME[60:]
PDU = CAM_FRAME[58:]
OTHERS = (1, 4, 6, 16, 102, 77, 255)  # messageIDs: DENM, SPATEM, IVIM, VAM of both profiles, unknown ones


def veth():
    ip("link add v2x0 type veth peer name air0")
    ip("link set v2x0 up")
    ip("link set air0 up")
    wait_for_carrier("v2x0", "air0")


def air():
    """Return a socket at the other end of the veth pair, which receives frames of any EtherType."""
    air = socket.socket(socket.AF_PACKET, socket.SOCK_RAW | socket.SOCK_NONBLOCK, socket.htons(0x8947))
    air.bind(("air0", 0x8947))
    return air


def started(host, shared=SHARED, **options):
    driver = Ethernet(EthernetOptions(**{"device": "v2x0", "beacon_s": 0.0, **options}), shared)
    driver.start(host)
    return driver


pytestmark = pytest.mark.namespace


def test_a_frame_of_another_station_arrives_with_all_that_it_says(loop, host):
    veth()
    started(host)
    air().send(CAM_FRAME)
    told(loop, lambda: host.indications)
    ((pdu, received_ns, rx),) = host.indications
    assert pdu == PDU
    assert received_ns > 1_600_000_000 * 10**9
    assert (rx.btp_port, rx.transport, rx.source_mac) == (2001, "shb", CAM_FRAME[6:12])
    assert rx.position == Position(487668616, 114320679)


def test_a_request_leaves_as_a_broadcast_of_the_devices_own_address(host):
    veth()
    driver = started(host)
    other = air()
    assert driver.send(request(CAM)) is Sent.NOW
    frame = other.recv(2048)
    assert frame[:14] == b"\xff" * 6 + device("v2x0").mac + bytes.fromhex("8947")
    assert frame.endswith(bytes.fromhex("07d10000") + CAM)


def test_a_request_with_an_area_is_a_geobroadcast_and_arrives_as_one(loop, host):
    veth()
    other = Host(loop)
    driver = started(host)
    started(other, device="air0")
    area = Area(Shape.CIRCLE, EGO.position, 500)
    driver.send(request(DENM, area=area))
    told(loop, lambda: other.indications)
    ((pdu, _, rx),) = other.indications
    assert (pdu, rx.btp_port, rx.transport, rx.area) == (DENM, 2002, "gbc", area)


def test_a_configured_address_is_the_sender(host):
    veth()
    driver = started(host, mac="02:00:00:00:00:0c")
    other = air()
    driver.send(request(CAM))
    assert other.recv(2048)[6:12] == MAC


def sent_with(host, shared, **options):
    """Return the position vector in the first packet that a station with these options sends."""
    driver = started(host, shared, **options)
    other = air()
    driver.send(request(CAM))
    packet = parse(other.recv(2048)[14:])
    driver.stop()
    return packet


def test_the_station_says_what_it_is(host):
    veth()
    shared = SHARED._replace(station_type=15, is_mobile=False)
    packet = sent_with(host, shared)
    assert packet.extended.source.address == Address(False, 15, 0, device("v2x0").mac)
    assert packet.common.flags == 0


@pytest.mark.parametrize("is_configured", [True, False])
def test_an_address_of_the_interfaces_own_options_is_a_configured_one_and_the_devices_is_not(host, is_configured):
    veth()
    shared = SHARED._replace(is_mac_configured=is_configured)
    assert sent_with(host, shared, mac="02:00:00:00:00:0c").extended.source.address.is_manual
    assert not sent_with(host, shared).extended.source.address.is_manual


def test_beacons_are_sent_and_heard(loop, host):
    veth()
    other = Host(loop)
    started(host, beacon_s=3.0)
    started(other, device="air0", mac="02:00:00:00:00:0d")
    loop.run_until(lambda: other.neighbours, within=10)
    assert other.neighbours[0] != bytes(6)
    assert other.drops == {}


def test_denms_are_read_before_a_queue_of_cams(loop, host):
    veth()
    started(host)
    other = air()
    for frame in [CAM_FRAME] * 20 + [DENM_FRAME] * 3:
        other.send(frame)
    told(loop, lambda: host.count == 23)
    ports = [rx.btp_port for _, _, rx in host.indications]
    assert ports == [2001] * 8 + [2002] * 3 + [2001] * 12


@pytest.mark.parametrize("frame", [CAM_FRAME, DENM_FRAME])
def test_what_the_kernel_dropped_is_counted_to_the_last_frame(loop, host, frame):
    veth()
    driver = started(host, receive_buffer=4096)
    other = air()
    for _ in range(3000):
        other.send(frame)
    driver.refresh()
    dropped = host.drops[Reason.KERNEL_QUEUE]
    told(loop, lambda: host.count == 3000 - dropped)
    driver.refresh()
    assert host.drops == {Reason.KERNEL_QUEUE: dropped}
    assert 0 < host.count < 3000


def test_what_was_dropped_before_a_stop_is_counted_by_the_stop(loop, host):
    veth()
    driver = started(host, receive_buffer=4096)
    other = air()
    for _ in range(3000):
        other.send(CAM_FRAME)
    driver.stop()
    assert 0 < host.drops[Reason.KERNEL_QUEUE] < 3000


def by_message(number):
    return CAM_FRAME[:59] + bytes([number]) + CAM_FRAME[60:]


def flood_with_others_between(sender):
    """Send 3000 CAMs, and at 50 places among them a frame of each other type. Return the number of the others."""
    for number in range(3000):
        sender.send(CAM_FRAME)
        if number % 60 == 0:
            for other in OTHERS:
                sender.send(by_message(other))
    return 50 * len(OTHERS)


def others_of(host):
    return [pdu[1] for pdu in host.pdus if pdu[1] != 2]


LANED = SHARED._replace(lanes=Topics().lanes())


def test_a_flood_of_cams_takes_no_frame_of_another_type(loop, host):
    veth()
    # The buffer has room for the 150 frames of the last lane, but not for 3000 CAMs.
    driver = started(host, LANED, receive_buffer=150_000)
    others = flood_with_others_between(air())
    driver.refresh()
    dropped = host.drops[Reason.KERNEL_QUEUE]
    assert 0 < dropped < 3000
    told(loop, lambda: host.count == 3000 + others - dropped)
    assert sorted(others_of(host)) == sorted(OTHERS * 50)
    driver.refresh()
    assert host.drops == {Reason.KERNEL_QUEUE: dropped}


def test_a_device_that_was_down_for_a_while_keeps_the_lanes_apart(loop, host):
    veth()
    driver = started(host, LANED, receive_buffer=150_000)
    for state in ("down", "up", "down", "up"):
        ip(f"link set v2x0 {state}")
        told(loop, lambda state=state: host.is_up is (state == "up"))
    others = flood_with_others_between(air())
    driver.refresh()
    dropped = host.drops[Reason.KERNEL_QUEUE]
    told(loop, lambda: host.count == 3000 + others - dropped)
    assert sorted(others_of(host)) == sorted(OTHERS * 50)


def test_lanes_that_open_when_the_device_comes_up_are_as_good(loop, host):
    veth()
    ip("link set v2x0 down")
    started(host, LANED)
    ip("link set v2x0 up")
    told(loop, lambda: host.is_up)
    sender = air()
    for number in (2, *OTHERS):
        sender.send(by_message(number))
    told(loop, lambda: host.count == 1 + len(OTHERS))
    assert sorted(others_of(host)) == sorted(OTHERS)


def test_lanes_that_cannot_open_when_the_device_comes_up_fail_the_interface_which_can_start_again(
    loop, host, monkeypatch
):
    veth()
    ip("link set v2x0 down")
    driver = started(host, LANED)
    with monkeypatch.context() as patch:
        patch.setattr("drivers.ethernet.fan_out", _refuse)
        ip("link set v2x0 up")
        told(loop, lambda: host.failures)
    assert str(host.failures[0]) == "v2x0: invalid argument"
    assert not host.is_up
    driver.stop()
    driver.start(host)
    air().send(CAM_FRAME)
    told(loop, lambda: host.count)


def _refuse(sockets, program):
    raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))


def test_two_stations_at_one_device_have_all_frames_each(loop, host):
    veth()
    second = Host(loop)
    drivers = [started(one, LANED) for one in (host, second)]
    sender = air()
    for number in (2, *OTHERS):
        sender.send(by_message(number))
    told(loop, lambda: host.count == second.count == 1 + len(OTHERS))
    drivers[0].stop()
    sender.send(CAM_FRAME)
    told(loop, lambda: second.count == 2 + len(OTHERS))
    assert host.drops == second.drops == {}


def test_two_devices_of_one_station_are_not_mixed(loop, host):
    veth()
    second = Host(loop)
    started(host, LANED)
    started(second, LANED, device="air0")
    air().send(by_message(4))
    told(loop, lambda: host.count)
    loop.run_for(0.1)
    assert (host.count, second.count) == (1, 0)


def test_frames_that_end_anywhere_are_received_each_once(loop, host):
    veth()
    driver = started(host, LANED)
    sender = air()
    frames = [frame[:end] for frame in FRAMES.values() for end in range(15, len(frame))]
    for number, frame in enumerate(frames, 1):
        sender.send(frame)
        if number % 100 == 0:
            told(loop, lambda expected=number: host.total == expected)
    loop.run_for(0.1)
    driver.refresh()
    assert host.total == len(frames)


def test_a_flood_to_another_station_is_neither_received_nor_counted_as_lost(loop, host):
    veth()
    driver = started(host, LANED, receive_buffer=4096)
    sender = air()
    for _ in range(1000):
        sender.send(bytes.fromhex("020000000077") + CAM_FRAME[6:])
    sender.send(CAM_FRAME)
    told(loop, lambda: host.count)
    driver.refresh()
    assert (host.total, host.drops) == (1, {})


def test_own_frames_do_not_come_back_nor_count(loop, host):
    veth()
    driver = started(host, LANED)
    other = air()
    for number in range(100):
        driver.send(request(CAM, number))
    assert len([other.recv(2048) for _ in range(100)]) == 100
    loop.run_for(0.1)
    driver.refresh()
    assert host.total == 0


def test_own_frames_that_come_back_are_named(loop, host):
    veth()
    driver = started(host)
    other = air()
    driver.send(request(CAM))
    other.send(other.recv(2048))
    told(loop, lambda: host.total)
    assert host.drops == {Reason.OWN_ECHO: 1}


def test_frames_to_other_stations_are_taken_only_when_promiscuous(loop, host):
    veth()
    second = Host(loop)
    frame = bytes.fromhex("020000000077") + CAM_FRAME[6:]
    driver = started(host)
    air().send(frame)
    loop.run_for(0.1)
    alone = host.total
    driver.stop()
    started(second, promiscuous=True)
    air().send(frame)
    told(loop, lambda: second.total)
    assert (alone, second.pdus) == (0, [PDU])


def test_a_device_that_is_down_at_the_start_is_waited_for(loop, host):
    veth()
    ip("link set v2x0 down")
    driver = started(host)
    assert host.links == [(False, "v2x0 is down or has no carrier: ip link set v2x0 up")]
    ip("link set v2x0 up")
    told(loop, lambda: host.is_up)
    assert driver.send(request(CAM)) is Sent.NOW


def test_a_cable_that_is_pulled_takes_the_link_down_and_up_again(loop, host):
    veth()
    driver = started(host)
    ip("link set air0 down")
    told(loop, lambda: not host.is_up)
    ip("link set air0 up")
    told(loop, lambda: host.is_up)
    other = air()
    assert driver.send(request(CAM)) is Sent.NOW
    assert other.recv(2048).endswith(CAM)
    assert host.failures == []


def test_a_device_that_is_gone_fails_the_interface_and_serves_again_when_it_is_back(loop, host):
    veth()
    driver = started(host)
    ip("link del v2x0")
    told(loop, lambda: host.failures)
    assert str(host.failures[0]) == "network device v2x0 is gone"
    driver.stop()
    with pytest.raises(InterfaceError, match="v2x0: no such network device"):
        driver.start(host)
    veth()
    driver.start(host)
    air().send(CAM_FRAME)
    told(loop, lambda: host.indications)


def test_a_device_made_again_under_its_name_is_not_mistaken_for_the_old_one(loop, host):
    veth()
    started(host)
    ip("link del v2x0")
    veth()
    told(loop, lambda: host.failures)


def test_sending_by_a_device_that_has_just_gone_fails_once(loop, host):
    veth()
    driver = started(host)
    ip("link del v2x0")
    assert driver.send(request(CAM)) is Sent.BUSY
    loop.run_for(0.1)
    assert [str(failure) for failure in host.failures] == ["network device v2x0 is gone"]


def test_sending_by_a_device_that_has_just_gone_down_keeps_the_request(loop, host):
    veth()
    driver = started(host)
    ip("link set v2x0 down")
    assert driver.send(request(CAM)) is Sent.BUSY
    assert not host.is_up
    assert host.failures == []


# Socket priority of each traffic class, in the order sent. TC-ID 0 is AC_VO, 1 AC_VI, 2 AC_BE, 3 AC_BK; the others are
# reserved. The two bits before the TC-ID do not affect the queue. cfg80211_classify8021d() expects 256 plus a user
# priority.
PRIORITIES = {2: 0, 0: 263, 1: 261, 3: 257, 0x82: 256, 0x41: 261, 63: 256}


def sent_by_class(driver):
    """Return the socket priority with which each traffic class was sent."""
    found = {}
    for traffic_class in PRIORITIES:
        assert driver.send(request(CAM)._replace(traffic_class=traffic_class)) is Sent.NOW
        found[traffic_class] = driver._device._transmitter.getsockopt(socket.SOL_SOCKET, socket.SO_PRIORITY)
    return found


def test_the_traffic_class_chooses_the_queue_of_the_radio(host):
    veth()
    driver = started(host)
    assert sent_by_class(driver) == PRIORITIES
    assert len(host.links) == 1
    driver.stop()
    driver.start(host)
    assert sent_by_class(driver) == PRIORITIES


def test_without_the_privilege_for_it_messages_leave_all_the_same_and_the_link_says_so_once(host):
    veth()
    driver = started(host)
    _give_up_privileges()
    assert set(sent_by_class(driver).values()) == {0}
    assert [is_up for is_up, _ in host.links] == [True, True]
    assert "traffic classes do not reach the radio" in host.links[-1][1]
    assert host.failures == []


def test_a_beacon_leaves_by_the_class_in_its_header(loop, host):
    veth()
    driver = started(host, beacon_s=3.0)
    other = air()
    loop.run_for(8)
    assert other.recv(2048)[20] == 0
    assert driver._device._transmitter.getsockopt(socket.SOL_SOCKET, socket.SO_PRIORITY) == 263


class Full:
    """Socket whose device has a full queue."""

    def send(self, octets):
        raise OSError(errno.ENOBUFS, os.strerror(errno.ENOBUFS))


def test_a_full_device_is_asked_again_also_after_a_stop_while_it_was_full(loop, host, monkeypatch):
    veth()
    driver = started(host)
    for _ in range(2):
        with monkeypatch.context() as patch:
            patch.setattr(driver._device, "_transmitter", Full())
            assert driver.send(request(CAM)) is Sent.BUSY
        driver.stop()
        driver.start(host)
    with monkeypatch.context() as patch:
        patch.setattr(driver._device, "_transmitter", Full())
        assert driver.send(request(CAM)) is Sent.BUSY
    loop.run_until(lambda: host.times_writable == 1, within=0.1)
    assert driver.send(request(CAM)) is Sent.NOW


def test_a_frame_longer_than_the_device_takes_is_the_users_fault(host):
    veth()
    ip("link set v2x0 mtu 200")
    driver = started(host)
    with pytest.raises(RequestError, match="too long for v2x0"):
        driver.send(request(CAM + bytes(300)))
    assert driver.send(request(CAM)) is Sent.NOW


def test_without_the_privilege_the_remedy_is_said(host):
    veth()
    _give_up_privileges()
    with pytest.raises(InterfaceError, match="not permitted") as failure:
        started(host)
    assert "AmbientCapabilities=CAP_NET_RAW" in failure.value.hint
    assert "setcap" not in failure.value.hint  # the one-file binary does not start with setcap


def _give_up_privileges():
    """Drop all capabilities of this process by capset(). PR_SET_NO_NEW_PRIVS alone does not drop them."""
    import ctypes

    libc = ctypes.CDLL(None, use_errno=True)
    header = (ctypes.c_uint32 * 2)(0x20080522, 0)  # _LINUX_CAPABILITY_VERSION_3, this process
    nothing = (ctypes.c_uint32 * 6)()
    assert libc.capset(header, nothing) == 0, os.strerror(ctypes.get_errno())


@pytest.mark.parametrize("table", [
    {}, {"device": ""}, {"device": "a" * 16}, {"device": "wlan0", "mac": "02:00:00:00:00"},
    {"device": "wlan0", "mac": "03:00:00:00:00:01"}, {"device": "wlan0", "mac": "020000000001"},
    {"device": "wlan0", "mac": "02:00:00:00:00:zz"}, {"device": "wlan0", "beacon_s": -1.0},
])  # fmt: skip
def test_options_that_cannot_be_meant_are_refused(table):
    with pytest.raises(ConfigurationError, match=r"captain\.toml"):
        read(EthernetOptions, table, "captain.toml")


def test_each_option_that_cannot_be_meant_is_told_with_its_key():
    with pytest.raises(ConfigurationError) as refused:
        read(EthernetOptions, {"device": "a/b", "mac": "zz"}, "captain.toml")
    assert refused.value.message.split("\n") == [
        'captain.toml: device: invalid name of a network device: "a/b"; `ip -brief link` lists them',
        'captain.toml: mac: invalid MAC address of a station: "zz"; write for example 02:00:00:00:00:0b',
    ]
