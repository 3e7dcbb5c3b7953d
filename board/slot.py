"""The sequencer of one slot: power, reset and its device, as a table of states driven by the loop's timers."""

from collections import deque
from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple

from board.description import SlotDescription
from board.errors import InterfaceError, StationError
from board.loop import Loop, Timer
from board.presence import Presence
from board.supply import Done, Kind, Supply, Switch
from board.usb import Device

STEADY_S = 2.0  # that a device stays, before a fault is over
PASSAGES = 64  # of the time line


class State(StrEnum):
    """Of a slot."""

    OFF = "off"  # in reset and without power, or on the way there, or as the station found it
    POWERED = "powered"  # power is on, or just being switched on; in reset
    RELEASED = "released"  # out of reset; its device is waited for
    PRESENT = "present"  # its device is there
    FAULT = "fault"  # something failed; all switches are left as they are


class Event(StrEnum):
    """What happens to it."""

    POWER = "power is asked for"
    CUT = "a cut is asked for"
    CYCLE = "a power cycle is asked for"
    READY = "power is asked for, and off_s is over"
    SETTLED = "settle_s is over, and reset released"
    SEEN = "its device is there"
    GONE = "its device is gone"
    LATE = "wait_s is over"
    FLAPPING = "its device went too often"
    STEADY = "its device stays"
    FAILED = "a switch failed"


MEANS: dict[Kind | None, str] = {
    "power": "its power line",
    "hub_port": "its hub's port",
    "authorize": "authorized: it keeps its power, and the kernel lets go of it",
    None: "nothing: the board file gives neither power, hub_port nor usb",
}


class Passage(NamedTuple):
    """A state of the past or the present: when it began, by the loop's clock, why, and what to do about that."""

    state: State
    began_s: float
    why: str
    hint: str = ""


class Slot:
    """One slot. Only the supervisor of the station calls power(), cut() and cycle().

    is_rested  off for off_s, or as the station found it.
    cause      why it is in fault, or was until the try that now runs: the first of its causes.
    note       what an operator should know of a slot without fault; empty: nothing.
    is_unswitched  in fault because a switch failed: its supply is not known.
    is_empty  in fault because nothing was plugged in while its device was waited for.
    device     what is there, when it is present; None also where the board file does not say where to look.
    timeline   the last states it went through.
    """

    def __init__(
        self,
        loop: Loop,
        name: str,
        description: SlotDescription,
        switch: Switch,
        look: Callable[[], Device | None],
        on_change: Callable[["Slot"], None],
    ) -> None:
        """Touches nothing until power() or cut().

        switch     switches one thing on or off (reset: active or inactive), and calls done with what failed, at once
                   or later; it is asked for one thing at a time.
        look       says what is plugged in at its place now.
        on_change  is told when a state was entered, and when it has been off for off_s.
        """
        self.name = name
        self.description = description
        self.state = State.OFF
        self.is_rested = True
        self.is_unswitched = self.is_empty = False
        self.cause: StationError | None = None
        self.note = ""
        self.device: Device | None = None
        self.timeline: deque[Passage] = deque([Passage(State.OFF, loop.clock(), "as it was found")], PASSAGES)
        self._loop = loop
        self._on_change = on_change
        self._supply = Supply(loop, description, switch, look)
        self._presence = Presence(description, look, loop.clock)
        self._is_wanted = False
        self._events: deque[tuple[Event, str | StationError]] = deque()
        self._timer: Timer | None = None

    def power(self) -> None:
        """Supply it, once it has been off for off_s; in fault: a power cycle."""
        self._happen(Event.POWER)

    def cut(self) -> None:
        """Take its supply away, whatever it is doing."""
        self._happen(Event.CUT)

    def cycle(self) -> None:
        """Cut, and supply it again after off_s."""
        self._happen(Event.CYCLE)

    def device_changed(self) -> None:
        """Something was plugged in or out at its place, or may have been."""
        if not self._presence.is_known or not self._is_wanted:
            return
        found = self._presence.find()
        if self.state is State.PRESENT and not self._is_same(found):
            fault = self._presence.lose()
            self._happen(Event.FLAPPING if fault else Event.GONE, fault or "")
        else:
            self._happen(Event.SEEN if found else Event.GONE, str(found or ""))

    def status(self) -> dict[str, object]:
        """What an operator is shown, as JSON."""
        return {
            "title": self.description.title,
            "state": self.state.value,
            "for_s": round(self._loop.clock() - self.timeline[-1].began_s, 3),
            "why": self.timeline[-1].why,
            "cause": self.cause.message if self.cause else "",
            "hint": self.cause.hint if self.cause else "",
            "note": self.note,
            "usb": self.description.usb,
            "device": str(self.device or ""),
            "switched_by": MEANS[self._supply.means],
            "losses": self._presence.losses,
        }

    def _happen(self, event: Event, why: str | StationError = "") -> None:
        """One event after the other, in their order: actions, and who is told of changes, cause further ones."""
        self._events.append((event, why))
        if len(self._events) > 1:
            return
        while self._events:
            self._serve(*self._events[0])
            self._events.popleft()

    def _serve(self, event: Event, why: str | StationError) -> None:
        rule = TABLE.get((self.state, event))
        if rule is None:
            return
        is_change = rule.state is not self.state
        if is_change:
            self.is_unswitched = event is Event.FAILED
            self.is_empty = event is Event.LATE and self._presence.is_empty
            self._enter(rule.state, why or event.value)
        rule.act(self)
        if is_change:
            self._on_change(self)

    def _enter(self, state: State, why: str | StationError) -> None:
        self._stop()
        fault = why if isinstance(why, StationError) else InterfaceError(why)
        self.state = state
        self.timeline.append(Passage(state, self._loop.clock(), fault.message, fault.hint))
        if state is State.FAULT:
            self.cause = self.cause or fault

    # The actions of the table.

    def rest(self) -> None:
        """Nothing."""

    def want(self) -> None:
        self._is_wanted = True
        self._start_if_rested()

    def drop(self) -> None:
        """Cut because that was asked for: what failed before is forgotten."""
        self.cause = None
        self._cut(wanted=False)

    def restart(self) -> None:
        self._cut(wanted=True)

    def supply(self) -> None:
        if self._supply.was_cut and self._presence.find():
            self.note = f"its device stayed while it was cut; it is switched by {MEANS[self._supply.means]}"
        self._supply.on(self._unless_failed(lambda: self._after(self.description.settle_s, self._release)))

    def watch(self) -> None:
        """Wait for its device, which may be there already."""
        self.device = None
        self._after(self.description.wait_s, self._late)
        self.device_changed()
        if not self._presence.is_known:
            self.note = "its device is taken to be there: the board file does not say where on USB"
            self._happen(Event.SEEN, "assumed")

    def greet(self) -> None:
        self.device = self._presence.find()
        self.cause = None

    def doubt(self) -> None:
        """In fault: its device may be back, and if it stays, all is well."""
        found = self._presence.find()
        if not self._is_same(found):
            self._stop()
            self.device = found
            if found:
                self._after(STEADY_S, lambda: self._happen(Event.STEADY))

    # What they are made of. No state waits for more than one thing: one timer.

    def _cut(self, wanted: bool) -> None:
        self._stop()
        self._is_wanted, self.is_rested = wanted, False
        self.device = None
        self.note = ""
        self._presence.calm()
        self._supply.off(self._unless_failed(lambda: self._after(self.description.off_s, self._rested)))

    def _late(self) -> None:
        self.device_changed()  # the kernel may not have told of it
        if self.state is State.RELEASED:
            self._happen(Event.LATE, self._presence.why_absent())

    def _rested(self) -> None:
        self.is_rested = True
        if self._is_wanted:
            self._start_if_rested()
        else:
            self._on_change(self)

    def _start_if_rested(self) -> None:
        if self.is_rested:
            self._happen(Event.READY)

    def _release(self) -> None:
        self._supply.release(self._unless_failed(lambda: self._happen(Event.SETTLED)))

    def _unless_failed(self, then: Callable[[], None]) -> Done:
        def done(error: StationError | None) -> None:
            if error:
                self._happen(Event.FAILED, error)
            else:
                then()

        return done

    def _is_same(self, found: Device | None) -> bool:
        """Whether it is the one that we know: whoever was plugged in again has another number."""
        return found is not None and self.device is not None and found.number == self.device.number

    def _after(self, delay_s: float, call: Callable[[], None]) -> None:
        self._stop()
        self._timer = self._loop.after(delay_s, call)

    def _stop(self) -> None:
        """Wait for nothing any more."""
        self._supply.stop()
        if self._timer is not None:
            self._timer.cancel()


class Rule(NamedTuple):
    """What is done, in the state that follows."""

    state: State
    act: Callable[[Slot], None] = Slot.rest


# What is not here changes nothing.
TABLE: dict[tuple[State, Event], Rule] = {
    (State.OFF, Event.POWER): Rule(State.OFF, Slot.want),
    (State.OFF, Event.READY): Rule(State.POWERED, Slot.supply),
    (State.OFF, Event.FAILED): Rule(State.FAULT),
    (State.POWERED, Event.SETTLED): Rule(State.RELEASED, Slot.watch),
    (State.POWERED, Event.FAILED): Rule(State.FAULT),
    (State.RELEASED, Event.SEEN): Rule(State.PRESENT, Slot.greet),
    (State.RELEASED, Event.LATE): Rule(State.FAULT),
    (State.PRESENT, Event.GONE): Rule(State.RELEASED, Slot.watch),
    (State.PRESENT, Event.FLAPPING): Rule(State.FAULT, Slot.doubt),
    (State.FAULT, Event.POWER): Rule(State.OFF, Slot.restart),
    (State.FAULT, Event.SEEN): Rule(State.FAULT, Slot.doubt),
    (State.FAULT, Event.GONE): Rule(State.FAULT, Slot.doubt),
    (State.FAULT, Event.STEADY): Rule(State.PRESENT, Slot.greet),
    **{(state, Event.CUT): Rule(State.OFF, Slot.drop) for state in State},
    **{(state, Event.CYCLE): Rule(State.OFF, Slot.restart) for state in State},
}
