"""Uevents: the kernel's text, and a Source that tells of them, here from a simulated kernel."""

import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.errors import InterfaceError
from board.uevent import BATCH, Uevents, parse
from drivers.sim.uevents import UeventSender

# Laid out as lib/kobject_uevent.c does, with what the option driver's tty has.
TTY = (
    b"add@/devices/platform/scb/fd500000.pcie/pci0000:00/0000:00:00.0/0000:01:00.0/usb1/1-1/1-1.3/1-1.3:1.2/ttyUSB2/tty/ttyUSB2\0"
    b"ACTION=add\0"
    b"DEVPATH=/devices/platform/scb/fd500000.pcie/pci0000:00/0000:00:00.0/0000:01:00.0/usb1/1-1/1-1.3/1-1.3:1.2/ttyUSB2/tty/ttyUSB2\0"
    b"SUBSYSTEM=tty\0MAJOR=188\0MINOR=2\0DEVNAME=ttyUSB2\0SEQNUM=2861\0"
)
# udev says it again in a form of its own: "libudev", a magic number, offsets, then the properties.
UDEV = b"libudev\0\xfe\xed\xca\xfe\x28\0\0\0\x28\0\0\0\x30\0\0\0ACTION=add\0DEVPATH=/devices/x\0"

TEXT = st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)))
KEYS = st.text("ABCDEFGHIJKLMNOPQRSTUVWXYZ_0123456789", min_size=1).filter(
    lambda key: key not in ("ACTION", "DEVPATH", "SUBSYSTEM")
)


def test_what_the_kernel_says_is_read():
    event = parse(TTY)
    assert (event.action, event.subsystem) == ("add", "tty")
    assert event.devpath.endswith("/1-1.3/1-1.3:1.2/ttyUSB2/tty/ttyUSB2")
    assert event.properties["DEVNAME"] == "ttyUSB2"
    assert event.properties["SEQNUM"] == "2861"


@given(
    action=st.text("abcdefghijklmnopqrstuvwxyz", min_size=1), path=TEXT, more=st.dictionaries(KEYS, TEXT, max_size=5)
)
def test_whatever_has_the_kernels_form_is_read_as_it_is(action, path, more):
    said = {"ACTION": action, "DEVPATH": f"/{path}", "SUBSYSTEM": "usb", **more}
    octets = "\0".join([f"{action}@/{path}", *(f"{key}={value}" for key, value in said.items()), ""]).encode()
    assert parse(octets) == (action, f"/{path}", "usb", said)


@pytest.mark.parametrize(
    "octets",
    [
        b"",
        b"\0",
        b"add@/devices/x",
        b"add@/devices/x\0",
        b"add@devices/x\0ACTION=add\0DEVPATH=devices/x\0",
        b"add@/devices/x\0ACTION=remove\0DEVPATH=/devices/x\0",
        b"add@/devices/x\0ACTION=add\0DEVPATH=/devices/y\0",
        b"add@/devices/x\0ACTION=add\0DEVPATH=/devices/x\0no property\0",
        b"ACTION=add\0DEVPATH=/devices/x\0SUBSYSTEM=usb\0",
        UDEV,
        TTY[:200],
    ],
)
def test_what_is_not_the_kernels_is_none(octets):
    assert parse(octets) is None


@given(octets=st.binary(max_size=200) | st.binary(max_size=40).map(lambda end: TTY + end))
def test_any_octets_are_an_event_or_none(octets):
    event = parse(octets)
    assert event is None or octets.startswith(event.action.encode("utf-8", "surrogateescape") + b"@/")


def test_a_name_that_is_no_utf_8_keeps_its_octets():
    event = parse(b"add@/devices/\xff\0ACTION=add\0DEVPATH=/devices/\xff\0SUBSYSTEM=block\0")
    assert event.devpath.encode("utf-8", "surrogateescape") == b"/devices/\xff"


# The Source.


@pytest.fixture
def events():
    return []


@pytest.fixture
def uevents(loop, machine, events):
    uevents = Uevents(loop, machine.machine, events.append)
    yield uevents
    uevents.close()


@pytest.fixture
def sender(machine):
    return machine._uevents


def say(sender, number):
    sender.send("change", f"/devices/{number}", "usb")


def paths(events):
    return [event and event.devpath for event in events]


def test_everyone_who_listens_is_told_in_order(loop, machine, uevents, events, sender):
    others = []
    other = Uevents(loop, machine.machine, others.append)
    for number in range(3):
        say(sender, number)
    loop.run_for(1)
    assert paths(events) == paths(others) == ["/devices/0", "/devices/1", "/devices/2"]
    other.close()


def test_a_turn_reads_a_bounded_number(loop, uevents, events, sender):
    for number in range(BATCH + 1):
        say(sender, number)
    loop.turn()
    assert len(events) == BATCH
    loop.turn()
    assert len(events) == BATCH + 1


def test_who_reads_too_slowly_is_told_that_something_was_missed_and_hears_what_follows(loop, uevents, events, sender):
    number = 0
    say(sender, number)
    while sender._listeners:  # until its queue is full
        number += 1
        say(sender, number)
    loop.run_for(1)
    assert paths(events) == [*(f"/devices/{before}" for before in range(number)), None]
    assert uevents.missed == 1
    say(sender, "later")
    loop.run_for(1)
    assert paths(events)[-1] == "/devices/later"


def test_what_is_no_uevent_is_counted_and_not_told(loop, uevents, events, sender):
    say(sender, 1)
    for garbage in (UDEV, b"garbage", TTY[:200]):
        sender._listeners[0].send(garbage)
    loop.run_for(1)
    assert (len(events), uevents.ignored) == (1, 3)


def test_a_kernel_that_is_gone_is_told_once(loop, machine, uevents, events):
    machine.close()
    loop.run_for(1)
    assert events == [None]
    assert uevents.fileno() < 0


def test_who_is_told_may_close_and_is_told_no_more(loop, machine, sender):
    told = []

    def close(event):
        told.append(event)
        listener.close()

    listener = Uevents(loop, machine.machine, close)
    say(sender, 1)
    say(sender, 2)
    loop.run_for(1)
    assert len(told) == 1
    listener.close()


def test_nobody_to_listen_to_is_an_error(loop, tmp_path, machine):
    with pytest.raises(InterfaceError, match=f"uevents at {tmp_path}/none: cannot listen: no such file"):
        Uevents(loop, machine.machine._replace(uevents=f"{tmp_path}/none"), print)


def test_a_listener_that_goes_is_forgotten(loop, machine, sender):
    listener = Uevents(loop, machine.machine, print)
    say(sender, 1)
    listener.close()
    say(sender, 2)
    assert sender._listeners == []


def test_a_sender_needs_no_listener(tmp_path):
    sender = UeventSender(tmp_path / "socket")
    say(sender, 1)
    sender.close()
    sender.close()
    with pytest.raises(OSError, match="No such file"), socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as late:
        late.connect(sender.path)
