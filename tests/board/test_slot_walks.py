"""A slot under whatever happens in whatever order: random walks in virtual time, with slow and broken switches."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from board.description import SlotDescription
from board.runtime.errors import InterfaceError
from board.slot import TABLE, SequencerState, SlotSequencer
from board.supply import ANSWER_S
from board.usb import UsbDevice
from tests.virtual import VirtualLoop

MODEM = UsbDevice("1-1.3", 1, "1e0e", "9001")
BROKEN = InterfaceError("broken", "mend it")

LONGEST_S = 60.0  # of the waits of DESCRIPTIONS
DESCRIPTIONS = {
    "line and reset": SlotDescription(usb="1-1.3", ids=("1e0e:9001",), power="p", reset="r", wait_s=10.0, off_s=3.0),
    "hub port": SlotDescription(usb="1-1.3", hub_port=True, wait_s=10.0, off_s=3.0),
    "authorized": SlotDescription(usb="1-1.3", wait_s=10.0, off_s=3.0),
    "place unknown": SlotDescription(power="p", off_s=3.0),
    "no times": SlotDescription(usb="1-1.3", power="p", reset="r", settle_s=0.0, wait_s=0.0, off_s=0.0),
}

MOVES = {(state, rule.state) for (state, _), rule in TABLE.items()}
STEPS = st.one_of(
    st.sampled_from(["power", "cut", "cycle", "plug", "wrong", "unplug", "look", "break", "mend", "hang", "answer"]),
    st.floats(0.0, 15.0),
)


class Walk:
    """A slot that is watched at every step: what must never be, is not."""

    def __init__(self, description):
        self.loop = VirtualLoop()
        self.description = description
        self.found = None
        self.numbers = 0
        self.is_broken = self.is_slow = False
        self.waiting = []
        self.is_on = None  # as far as its switch is known to have done what was asked
        self.off_since = None
        self.first_cause = None
        self.slot = SlotSequencer(self.loop, "walk", description, self.switch, lambda: self.found, self.changed)
        self.state = self.slot.state

    def switch(self, kind, on, done):
        if kind != "reset":
            self.supply(kind, on)
        if self.is_slow:
            self.waiting.append(done)
        else:
            done(BROKEN if self.is_broken else None)

    def supply(self, kind, on):
        if on:
            assert self.is_on is not True, "power was switched on twice"
            if self.off_since is not None:
                assert self.loop.now - self.off_since >= self.description.off_s - 1e-6, "off_s was not kept"
        self.is_on = on
        self.off_since = None if on else self.loop.now
        if kind == "authorize" and self.found:
            self.found = self.found._replace(is_authorized=on)

    def changed(self, slot):
        assert (self.state, slot.state) in MOVES, "not in the table"
        self.state = slot.state
        if slot.state is SequencerState.FAULT:
            assert slot.cause is not None
            self.first_cause = self.first_cause or slot.cause
            assert slot.cause is self.first_cause, "the first cause was not kept"
        elif slot.cause is None:
            self.first_cause = None
        if slot.state is SequencerState.PRESENT:
            assert slot.cause is None

    def step(self, what):
        if isinstance(what, float):
            self.loop.run_for(what)
        else:
            getattr(self, what)()
        assert self.slot.state is self.state, "a change was not told"

    def power(self):
        self.slot.power()

    def cut(self):
        self.first_cause = None
        self.slot.cut()

    def cycle(self):
        self.slot.cycle()

    def plug(self):
        self.numbers += 1
        self.found = MODEM._replace(number=self.numbers)
        self.slot.device_changed()

    def wrong(self):
        self.found = MODEM._replace(vendor="1546", number=0)
        self.slot.device_changed()

    def unplug(self):
        self.found = None
        self.slot.device_changed()

    def look(self):
        self.slot.device_changed()

    def break_(self):
        self.is_broken = True

    def mend(self):
        self.is_broken = self.is_slow = False

    def hang(self):
        self.is_slow = True

    def answer(self):
        for done in (self.waiting.pop(0) for _ in range(len(self.waiting))):
            done(BROKEN if self.is_broken else None)


setattr(Walk, "break", Walk.break_)


@pytest.mark.parametrize("name", DESCRIPTIONS)
@settings(max_examples=60)
@given(steps=st.lists(STEPS, max_size=40))
def test_no_walk_leaves_the_table(name, steps):
    walk = Walk(DESCRIPTIONS[name])
    for what in steps:
        walk.step(what)
    # And from wherever it is, it comes up: power, a device, working switches.
    walk.mend()
    walk.loop.run_for(2 * ANSWER_S + LONGEST_S)
    walk.plug()
    walk.cut()
    walk.power()
    walk.loop.run_for(LONGEST_S)
    if walk.description.wait_s:
        walk.plug()
        walk.loop.run_for(LONGEST_S)
        assert walk.slot.state is SequencerState.PRESENT
    walk.loop.close()
