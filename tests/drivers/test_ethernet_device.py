"""Raw sockets: devices that go and come back, their queues, and privileges."""

import errno
import os
import socket

import pytest

from board.runtime.errors import InterfaceError
from drivers.contract import Sent
from tests.drivers.host import CAM, request, told
from tests.drivers.veth import CAM_FRAME, air, ip, started, veth

pytestmark = pytest.mark.namespace


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
