"""Sequencer of one slot: power, reset and its device, as a table of states.

Rules (TABLE below has every transition; an event without a row changes nothing):

# state      meaning                                 event                              -> state
#
# OFF        in reset, without power, or as the      power is asked for, off_s is over     POWERED
#            station found it                        a switch failed                       FAULT
# POWERED    supply is on, reset still active        settle_s is over, reset released      RELEASED
#                                                    a switch failed                       FAULT
# RELEASED   its device is awaited                   the right device is seen, or taken    PRESENT
#                                                    to be there as its place is unknown
#                                                    wait_s is over                        FAULT
# PRESENT    its device is there                     it goes                               RELEASED
#                                                    it went FLAPS times within FLAP_S     FAULT
# FAULT      all switches stay as they are           its device stays for STEADY_S         PRESENT
#                                                    power is asked for                    OFF, then a power cycle
# any        cut() -> OFF. cycle() -> OFF, and POWERED after off_s

Only the supervisor of the slot (firmware/slots) calls power(), cut() and cycle(); each is allowed in every state. The
carrier calls device_changed() at hot-plug, and the switch calls `done`. All of them may call from inside on_change():
an event waits in the queue until the action of the one before it has ended.

Each state waits for one event, so one timer is sufficient. Entering a state stops the timer and the switching of the
state before it, so that a late answer cannot act on another state.

A failed switch is a fault, also while power is cut. Earlier versions showed `off` while the module kept its power. The
first cause stays until a device is present again or cut() is called. The sequencer never retries: the supervisor
decides how often power is cycled and when a failed switch is tried again.
"""

from collections import deque
from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple

from board.description import SlotDescription
from board.presence import Presence
from board.runtime.errors import InterfaceError, StationError
from board.runtime.loop import Loop, Timer
from board.supply import Done, Kind, Supply, Switch
from board.usb import UsbDevice

STEADY_S = 2.0  # time that a device must stay before its fault ends
TRANSITIONS = 64  # most entries of the time line


class SequencerState(StrEnum):
    """State of a slot."""

    OFF = "off"  # in reset without power, or being switched off, or as the station found it
    POWERED = "powered"  # power is on or being switched on; in reset
    RELEASED = "released"  # out of reset; waits for the device
    PRESENT = "present"  # the device is present
    FAULT = "fault"  # a failure; all switches stay as they are


class Event(StrEnum):
    """Event of a slot."""

    POWER = "power-on requested"
    CUT = "power-off requested"
    CYCLE = "power cycle requested"
    READY = "power-on requested, and off_s has passed since the last power-off"
    SETTLED = "settle_s has passed since power-on; reset is released"
    SEEN = "its device is there"
    GONE = "its device is gone"
    LATE = "wait_s is over"
    FLAPPING = "its device went too often"
    STEADY = "its device stays"
    FAILED = "a switch failed"


MEANS: dict[Kind | None, str] = {
    "power": "its power line",
    "hub_port": "its hub's port",
    "authorize": "the USB attribute authorized: the kernel releases the device, which keeps its power",
    None: "nothing: the board file has neither power, hub_port nor usb for the slot",
}


class Transition(NamedTuple):
    """Past or present state: its begin by the loop's clock, its reason and a remedy."""

    state: SequencerState
    began_s: float
    why: str
    hint: str = ""


class SlotSequencer:
    """Sequencer of one slot; only the slot's supervisor calls power(), cut() and cycle().

    is_off_time_over  off for off_s, or as the station found it.
    cause             first cause of the fault, kept during the next try; None without one.
    note              notice for an operator about a slot without fault; empty: none.
    is_unswitched     in fault because a switch failed, so the state of the supply is unknown.
    is_empty          in fault because no device was plugged in during wait_s.
    device            the present device; None also if the board file does not give its USB port.
    timeline          the last states.
    """

    def __init__(
        self,
        loop: Loop,
        name: str,
        description: SlotDescription,
        switch: Switch,
        look: Callable[[], UsbDevice | None],
        on_change: Callable[["SlotSequencer"], None],
    ) -> None:
        """Create the sequencer; it switches nothing until power() or cut().

        switch     switches one thing on or off (reset: active or inactive), then calls `done` with the error or None,
                   at once or later. It is called for one thing at a time.
        look       returns the device at the slot's USB port, or None.
        on_change  called when a state was entered, and at the end of off_s.
        """
        self.name = name
        self.description = description
        self.state = SequencerState.OFF
        self.is_off_time_over = True
        self.is_unswitched = self.is_empty = False
        self.cause: StationError | None = None
        self.note = ""
        self.device: UsbDevice | None = None
        self.timeline: deque[Transition] = deque(
            [Transition(SequencerState.OFF, loop.clock(), "as it was found")], TRANSITIONS
        )
        self._loop = loop
        self._on_change = on_change
        self._supply = Supply(loop, description, switch, look)
        self._presence = Presence(description, look, loop.clock)
        self._is_wanted = False
        self._events: deque[tuple[Event, str | StationError]] = deque()
        self._timer: Timer | None = None

    def power(self) -> None:
        """Supply the slot, after off_s at the earliest; in a fault, cycle its power."""
        self._enqueue(Event.POWER)

    def cut(self) -> None:
        """Cut the supply in any state."""
        self._enqueue(Event.CUT)

    def cycle(self) -> None:
        """Cut the supply, and restore it after off_s."""
        self._enqueue(Event.CYCLE)

    def device_changed(self) -> None:
        """Look for the device again, because a device at the slot's USB port may have come or gone."""
        if not self._presence.is_known or not self._is_wanted:
            return
        found = self._presence.find()
        if self.state is SequencerState.PRESENT and not self._is_same(found):
            fault = self._presence.count_loss()
            self._enqueue(Event.FLAPPING if fault else Event.GONE, fault or "")
        else:
            self._enqueue(Event.SEEN if found else Event.GONE, str(found or ""))

    def status(self) -> dict[str, object]:
        """Return the status for operators, as JSON."""
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

    def _enqueue(self, event: Event, why: str | StationError = "") -> None:
        """Dispatch an event after the queued ones; actions and listeners may enqueue further events."""
        self._events.append((event, why))
        if len(self._events) > 1:
            return
        while self._events:
            self._dispatch(*self._events[0])
            self._events.popleft()

    def _dispatch(self, event: Event, why: str | StationError) -> None:
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

    def _enter(self, state: SequencerState, why: str | StationError) -> None:
        self._stop()
        fault = why if isinstance(why, StationError) else InterfaceError(why)
        self.state = state
        self.timeline.append(Transition(state, self._loop.clock(), fault.message, fault.hint))
        if state is SequencerState.FAULT:
            self.cause = self.cause or fault

    # Actions of TABLE.

    def do_nothing(self) -> None:
        """Change nothing but the state."""

    def request_power(self) -> None:
        """Ask for power; it is applied once off_s is over."""
        self._is_wanted = True
        self._power_if_ready()

    def cut_power(self) -> None:
        """Cut the power on request, and forget the last fault."""
        self.cause = None
        self._cut(wanted=False)

    def cold_cycle(self) -> None:
        """Cut the power, and apply it again after off_s."""
        self._cut(wanted=True)

    def apply_power(self) -> None:
        """Switch the power on, and release reset after settle_s."""
        if self._supply.was_cut and self._presence.find():
            self.note = f"its device stayed present while the power was off; switched by {MEANS[self._supply.means]}"
        self._supply.on(self._unless_failed(lambda: self._after(self.description.settle_s, self._release)))

    def await_device(self) -> None:
        """Wait up to wait_s for the device; if it is already present, the wait ends at once."""
        self.device = None
        self._after(self.description.wait_s, self._late)
        self.device_changed()
        if not self._presence.is_known:
            self.note = "the slot's device is assumed present: the board file gives no USB path for it"
            self._enqueue(Event.SEEN, "assumed")

    def accept_device(self) -> None:
        """Take the device as present, which ends a fault."""
        self.device = self._presence.find()
        self.cause = None

    def recheck_device(self) -> None:
        """In a fault, look for the device again; the fault ends if it stays for STEADY_S."""
        found = self._presence.find()
        if not self._is_same(found):
            self._stop()
            self.device = found
            if found:
                self._after(STEADY_S, lambda: self._enqueue(Event.STEADY))

    # Helpers of the actions. Each state waits for one thing only, so one timer is sufficient.

    def _cut(self, wanted: bool) -> None:
        self._stop()
        self._is_wanted, self.is_off_time_over = wanted, False
        self.device = None
        self.note = ""
        self._presence.forget_losses()
        self._supply.off(self._unless_failed(lambda: self._after(self.description.off_s, self._off_time_ended)))

    def _late(self) -> None:
        self.device_changed()  # a uevent of the kernel may have been lost
        if self.state is SequencerState.RELEASED:
            self._enqueue(Event.LATE, self._presence.why_absent())

    def _off_time_ended(self) -> None:
        self.is_off_time_over = True
        if self._is_wanted:
            self._power_if_ready()
        else:
            self._on_change(self)

    def _power_if_ready(self) -> None:
        if self.is_off_time_over:
            self._enqueue(Event.READY)

    def _release(self) -> None:
        self._supply.release(self._unless_failed(lambda: self._enqueue(Event.SETTLED)))

    def _unless_failed(self, then: Callable[[], None]) -> Done:
        def done(error: StationError | None) -> None:
            if error:
                self._enqueue(Event.FAILED, error)
            else:
                then()

        return done

    def _is_same(self, found: UsbDevice | None) -> bool:
        """Return whether `found` is the known USB device; the kernel gives a re-plugged device another number."""
        return found is not None and self.device is not None and found.number == self.device.number

    def _after(self, delay_s: float, call: Callable[[], None]) -> None:
        self._stop()
        self._timer = self._loop.after(delay_s, call)

    def _stop(self) -> None:
        """Stop the timer and the switching in progress."""
        self._supply.stop()
        if self._timer is not None:
            self._timer.cancel()


class Rule(NamedTuple):
    """Next state, and the action that runs in it."""

    state: SequencerState
    act: Callable[[SlotSequencer], None] = SlotSequencer.do_nothing


# A pair of state and event without a row changes nothing.
TABLE: dict[tuple[SequencerState, Event], Rule] = {
    (SequencerState.OFF, Event.POWER): Rule(SequencerState.OFF, SlotSequencer.request_power),
    (SequencerState.OFF, Event.READY): Rule(SequencerState.POWERED, SlotSequencer.apply_power),
    (SequencerState.OFF, Event.FAILED): Rule(SequencerState.FAULT),
    (SequencerState.POWERED, Event.SETTLED): Rule(SequencerState.RELEASED, SlotSequencer.await_device),
    (SequencerState.POWERED, Event.FAILED): Rule(SequencerState.FAULT),
    (SequencerState.RELEASED, Event.SEEN): Rule(SequencerState.PRESENT, SlotSequencer.accept_device),
    (SequencerState.RELEASED, Event.LATE): Rule(SequencerState.FAULT),
    (SequencerState.PRESENT, Event.GONE): Rule(SequencerState.RELEASED, SlotSequencer.await_device),
    (SequencerState.PRESENT, Event.FLAPPING): Rule(SequencerState.FAULT, SlotSequencer.recheck_device),
    (SequencerState.FAULT, Event.POWER): Rule(SequencerState.OFF, SlotSequencer.cold_cycle),
    (SequencerState.FAULT, Event.SEEN): Rule(SequencerState.FAULT, SlotSequencer.recheck_device),
    (SequencerState.FAULT, Event.GONE): Rule(SequencerState.FAULT, SlotSequencer.recheck_device),
    (SequencerState.FAULT, Event.STEADY): Rule(SequencerState.PRESENT, SlotSequencer.accept_device),
    **{(state, Event.CUT): Rule(SequencerState.OFF, SlotSequencer.cut_power) for state in SequencerState},
    **{(state, Event.CYCLE): Rule(SequencerState.OFF, SlotSequencer.cold_cycle) for state in SequencerState},
}
