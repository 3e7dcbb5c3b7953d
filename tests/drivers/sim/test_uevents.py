"""Uevents as the kernel reports them (board/uevent.py), in a network namespace."""

import socket

import pytest

from board.machine import REAL
from board.uevent import GROUP_KERNEL, NETLINK_KOBJECT_UEVENT, Uevents, parse
from tests.drivers.host import told
from tests.drivers.veth import ip

pytestmark = pytest.mark.namespace


def names(events):
    return [(event.action, event.properties.get("INTERFACE")) for event in events if event and event.subsystem == "net"]


def test_a_network_device_that_comes_and_goes_is_told(loop):
    events = []
    Uevents(loop, REAL, events.append)
    ip("link add v2x0 type veth peer name air0")
    told(loop, lambda: {("add", "v2x0"), ("add", "air0")} <= set(names(events)))
    ip("link del v2x0")
    told(loop, lambda: ("remove", "v2x0") in names(events))
    assert next(event.devpath for event in events if event) == "/devices/virtual/net/air0"


def test_more_than_the_socket_holds_is_told_as_missed(loop):
    events = []
    uevents = Uevents(loop, REAL, events.append)
    uevents._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
    for number in range(10):
        ip(f"link add many{number} type veth peer name more{number}")
    told(loop, lambda: None in events)
    assert uevents.missed == events.count(None)


def test_what_a_program_sends_is_ignored(loop):
    events = []
    uevents = Uevents(loop, REAL, events.append)
    forged = b"add@/devices/x\0ACTION=add\0DEVPATH=/devices/x\0SUBSYSTEM=usb\0"
    assert parse(forged)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_DGRAM, NETLINK_KOBJECT_UEVENT) as program:
        program.sendto(forged, (uevents._socket.getsockname()[0], 0))
    told(loop, lambda: uevents.ignored == 1)
    assert events == []


def test_it_listens_to_the_kernel_and_not_to_udev(loop):
    uevents = Uevents(loop, REAL, print)
    assert uevents._socket.getsockname()[1] == GROUP_KERNEL
    assert uevents._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) > 1 << 20
