"""A slot with all that is around it: kernel's files, hot-plug by uevents, a module that takes its time to boot."""

import pytest

from board import usb
from board.description import SlotDescription
from board.runtime.errors import InterfaceError
from board.slot import SequencerState, SlotSequencer
from board.topology import holder, of_devpath
from board.uevent import Uevents
from drivers.sim.machine import SimulatedDevice, SimulatedInterface
from tests.said import tells

PLACE = "1-1.3"
DEVICE = SimulatedDevice("1e0e", "9001", [SimulatedInterface(2, "option", "/dev/null")])
BOOT_S = 8.0


class Bench:
    """A place with a module, and its slot; what blocks is done at once."""

    def __init__(self, loop, machine, description):
        self.loop = loop
        self.machine = machine
        self.boots = 0
        self._timer = None
        self.states = []
        machine.sit(PLACE, self.supplied, ["power"] if description.power else [])
        self.slot = SlotSequencer(
            loop, "5g", description, self.switch, lambda: usb.find(machine.machine, PLACE), self.changed
        )
        self.uevents = Uevents(loop, machine.machine, self.told)

    def supplied(self, is_on):
        if self._timer:
            self._timer.cancel()
        if is_on:
            self.boots += 1
            self._timer = self.loop.after(BOOT_S, lambda: self.machine.plug(PLACE, DEVICE))

    def switch(self, kind, on, done):
        try:
            match kind:
                case "power":
                    self.machine.supply(PLACE, "power", on)
                case "hub_port":
                    usb.hub_port(self.machine.machine, PLACE, on)
                case "authorize":
                    usb.authorize(self.machine.machine, PLACE, on)
        except InterfaceError as error:
            done(error)
        else:
            self.machine.poll()
            done(None)

    def told(self, event):
        if event is None or holder(of_devpath(event.devpath), {"5g": PLACE}):
            self.slot.device_changed()

    def changed(self, slot):
        self.states.append(slot.state)

    def until(self, state):
        self.loop.run_until(lambda: self.slot.state is state)


LINE = SlotDescription(usb=PLACE, power="5g_power")
HUB_PORT = SlotDescription(usb=PLACE, hub_port=True)
AUTHORIZED = SlotDescription(usb=PLACE)


@pytest.fixture(params=[LINE, HUB_PORT, AUTHORIZED], ids=["line", "hub port", "authorized"])
def bench(request, loop, machine):
    bench = Bench(loop, machine, request.param)
    yield bench
    bench.uevents.close()


def test_a_slot_comes_up_is_cycled_and_comes_up_again(bench):
    bench.slot.power()
    bench.until(SequencerState.PRESENT)
    assert bench.boots == 1
    first = bench.slot.device.number
    bench.slot.cycle()
    bench.until(SequencerState.OFF)
    bench.until(SequencerState.PRESENT)
    assert bench.boots == 2
    assert bench.slot.device.number != first
    assert usb.tty(bench.machine.machine, PLACE, 2).endswith("ttyUSB1")
    assert bench.slot.note == ""


def test_a_module_that_is_pulled_out_is_a_fault_and_one_that_is_put_in_is_the_end_of_it(bench):
    bench.slot.power()
    bench.until(SequencerState.PRESENT)
    bench.machine.leave(PLACE)
    bench.until(SequencerState.FAULT)
    assert bench.slot.cause.message == "no USB device at 1-1.3 within 30 s"
    bench.machine.sit(PLACE, bench.supplied)
    bench.until(SequencerState.PRESENT)
    assert bench.slot.cause is None


@pytest.mark.parametrize("bench", [HUB_PORT], indirect=True)
def test_hub_that_switches_nothing_is_a_fault_with_hub_port(bench, monkeypatch):
    bench.slot.power()
    bench.until(SequencerState.PRESENT)
    monkeypatch.setattr(usb.sysfs, "switch", lambda path, is_on: None)
    bench.slot.cycle()
    assert bench.slot.state is SequencerState.FAULT
    assert tells(bench.slot.cause.message, "cannot switch", "single port")
    assert "hub_port = false" in bench.slot.cause.hint
