"""Network devices as the kernel reports them (board/netlink.py), in a network namespace."""

import socket

import pytest

from board.netlink import DeviceWatch, device
from tests.drivers.host import told
from tests.drivers.veth import ip, wait_for_carrier

pytestmark = pytest.mark.namespace


def veth():
    ip("link add v2x0 address 02:00:00:00:00:42 type veth peer name air0")
    ip("link set v2x0 up")
    ip("link set air0 up")
    wait_for_carrier("v2x0", "air0")


def test_a_device_is_described_as_it_is():
    veth()
    found = device("v2x0")
    assert found == (socket.if_nametoindex("v2x0"), True, True, bytes.fromhex("020000000042"))
    assert found.is_usable


@pytest.mark.parametrize("name", ["", "none", "a name that is longer than any"])
def test_a_device_that_is_not_there_is_none(name):
    assert device(name) is None


def test_changes_of_other_devices_are_not_told(loop):
    veth()
    changes = []
    DeviceWatch(loop, "lo", changes.append)
    ip("link set v2x0 down")
    loop.run_for(1)
    assert changes == []


def test_what_the_kernel_could_not_tell_is_found_by_looking(loop):
    veth()
    changes = []
    watch = DeviceWatch(loop, "v2x0", changes.append)
    watch._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    for number in range(30):
        ip(f"link add many{number} type veth peer name more{number}")
    ip("link set v2x0 down")
    told(loop, lambda: changes)
    assert not changes[-1].is_up
    assert watch.state == changes[-1]


def test_a_closed_watch_tells_nothing_and_may_be_closed_again(loop):
    veth()
    changes = []
    watch = DeviceWatch(loop, "v2x0", changes.append)
    watch.close()
    watch.close()
    ip("link del v2x0")
    loop.run_for(1)
    assert changes == []
