"""Slot under test: its switches are a list, its device is a variable."""

import pytest

from board.description import SlotDescription
from board.slot import SequencerState, SlotSequencer
from board.usb import UsbDevice

FULL = SlotDescription(
    title="5G",
    usb="1-1.3",
    ids=("1e0e:9001",),
    power="5g_power",
    reset="5g_reset",
    settle_s=0.5,
    wait_s=20.0,
    off_s=5.0,
)
MODEM = UsbDevice("1-1.3", 7, "1e0e", "9001", "SimTech", "SDXPRAIRIE-MTP")
OTHER = UsbDevice("1-1.3", 9, "1546", "01a9", "u-blox AG", "u-blox GNSS receiver")


class Bench:
    """A slot whose switches are a list and whose device is a variable; answers come at once, or when answer() is called."""

    def __init__(self, loop, description=FULL, is_prompt=True):
        self.loop = loop
        self.found = None
        self.switched = []
        self.waiting = []
        self.failing = {}
        self.is_prompt = is_prompt
        self.changes = []
        self.slot = SlotSequencer(loop, "3", description, self.switch, lambda: self.found, self.changed)
        self.on_change = lambda slot: None

    def switch(self, kind, on, done):
        assert not self.waiting, "one at a time"
        self.switched.append((kind, on))
        if self.is_prompt:
            done(self.failing.get((kind, on)))
        else:
            self.waiting.append(done)

    def answer(self, error=None):
        done = self.waiting.pop()
        done(error)
        return done

    def changed(self, slot):
        self.changes.append(slot.state)
        self.on_change(slot)

    def plug(self, device=MODEM):
        self.found = device
        self.slot.device_changed()

    def unplug(self):
        self.plug(None)

    def take(self):
        """Return what was switched since the last call."""
        taken, self.switched = self.switched, []
        return taken

    def until(self, state, within=60.0):
        start = self.loop.now
        self.loop.run_until(lambda: self.slot.state is state, within)
        return self.loop.now - start


@pytest.fixture
def bench(loop):
    return Bench(loop)


UP = [("reset", True), ("power", True), ("reset", False)]
DOWN = [("reset", True), ("power", False)]


def bring(bench, state):
    """Into a state by what happens on the way there."""
    if state is SequencerState.OFF:
        return
    bench.slot.power()
    if state is not SequencerState.POWERED:
        bench.until(SequencerState.RELEASED)
    if state is SequencerState.PRESENT:
        bench.plug()
    if state is SequencerState.FAULT:
        bench.until(SequencerState.FAULT)
    assert bench.slot.state is state
