"""Raw sockets: lanes, frames that the kernel dropped, and frames of this and other stations."""

import errno
import os

import pytest

from drivers.reason import Reason
from firmware.topics import Topics
from tests.drivers.host import CAM, SHARED, Host, request, told
from tests.drivers.veth import CAM_FRAME, DENM_FRAME, FRAMES, PDU, air, ip, started, veth

pytestmark = pytest.mark.namespace


OTHERS = (1, 4, 6, 16, 102, 77, 255)  # messageIDs: DENM, SPATEM, IVIM, VAM of both profiles, unknown ones


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
