"""Power of a USB device: authorized, reset, hub port; and a slot."""

from collections.abc import Iterator

import pytest

from board import usb
from board.description import SlotDescription
from board.machine import REAL
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from board.slot import SequencerState, SlotSequencer
from board.supply import Done, Kind
from board.uevent import Uevents
from tests.proof.kernel.checks.gadget import MODEM, Gadget, modem_gadget
from tests.proof.kernel.checks.kernel import Seen, until


@pytest.fixture
def gadget(loop: Loop) -> Iterator[Gadget]:
    with modem_gadget() as made:
        made.plug()
        until(loop, lambda: _has_ttys(made))
        yield made


def test_a_device_that_is_not_authorized_has_no_port_and_comes_back(gadget: Gadget, loop: Loop, seen: Seen) -> None:
    usb.authorize(REAL, gadget.place, False)
    device = usb.find(REAL, gadget.place)
    assert device is not None
    assert not device.is_authorized
    with pytest.raises(InterfaceError) as refused:
        usb.tty(REAL, gadget.place, 2)
    usb.authorize(REAL, gadget.place, True)
    until(loop, lambda: _has_ttys(gadget))
    seen(f"off: {refused.value.message}; on: {usb.tty(REAL, gadget.place, 2)}")


def test_a_reset_leaves_a_device_that_works(gadget: Gadget, loop: Loop, seen: Seen) -> None:
    usb.reset(REAL, gadget.place)
    until(loop, lambda: _has_ttys(gadget))
    seen(f"{usb.tty(REAL, gadget.place, 2)} is there")


def test_the_power_of_a_port_takes_its_device_away(gadget: Gadget, loop: Loop, seen: Seen) -> None:
    usb.hub_port(REAL, gadget.place, False)
    until(loop, lambda: usb.find(REAL, gadget.place) is None)
    usb.hub_port(REAL, gadget.place, True)
    until(loop, lambda: _has_ttys(gadget))
    seen("off: gone; on: back")


def test_what_is_not_there_is_refused(gadget: Gadget, seen: Seen) -> None:
    bus = gadget.place.partition("-")[0]
    for call in (usb.authorize, usb.hub_port):
        with pytest.raises(InterfaceError) as refused:
            call(REAL, f"{bus}-9", True)
        seen(refused.value.message)


def test_a_slot_sees_its_device_come_be_cut_and_return(gadget: Gadget, loop: Loop, seen: Seen) -> None:
    description = SlotDescription(usb=gadget.place, ids=(MODEM,), settle_s=0.1, wait_s=20.0, off_s=1.0)

    def switch(kind: Kind, is_on: bool, done: Done) -> None:
        assert kind == "authorize"
        usb.authorize(REAL, gadget.place, is_on)
        done(None)

    slot = SlotSequencer(loop, "modem", description, switch, lambda: usb.find(REAL, gadget.place), lambda slot: None)
    uevents = Uevents(loop, REAL, lambda event: slot.device_changed())
    slot.power()
    until(loop, lambda: slot.state is SequencerState.PRESENT)
    slot.cycle()
    until(loop, lambda: slot.state is SequencerState.OFF)
    until(loop, lambda: slot.state is SequencerState.PRESENT)
    gadget.unplug()
    until(loop, lambda: slot.state is not SequencerState.PRESENT)
    gadget.plug()
    until(loop, lambda: slot.state is SequencerState.PRESENT)
    uevents.close()
    slot.cut()
    seen(", ".join(passage.state.value for passage in slot.timeline))


def _has_ttys(gadget: Gadget) -> bool:
    device = usb.find(REAL, gadget.place)
    try:
        return device is not None and bool(usb.tty(REAL, gadget.place, 2))
    except InterfaceError:
        return False
