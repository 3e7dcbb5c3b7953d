"""Slot supervisor: one slot's power, device and driver, as a table of states.

        start             device              driver runs
    ──────────> powering ────────> starting ─────────────> running
                 │    ^             │   ^      fails          │
           absent│    │device gone  │   └────────────────────┘
                 v    └─────────────┤stuck
               cycling <────────────┘           CYCLES without steady running ──> fault
                                                hot-plug, operator: fault ──> from the beginning

Rules (RULES below has every transition; an event without a row changes nothing):

The carrier board calls start(), stop() and sequencer_changed(). The operator's command calls operate(). The interface
supervisor calls driver_started() and driver_failed(). All these run on the loop and may be called in any state. Only
this class calls the sequencer's power(), cut() and cycle(), because two callers would cut each other's power.

The interface supervisor restarts a failed driver if driver_failed() returns True. After STARTS failures, or after a
StuckError, the slot is power-cycled instead. After CYCLES power cycles without a steady run, the slot enters a fault. A
BlockedError is not counted, because a power cycle does not free a port or install a library. A run is steady once the
link has been up for STEADY_S. An earlier version counted from the driver's start. A modem that failed after 90 s was
then cycled 35 times an hour, without a fault.

If a switch fails, the slot enters a fault at once, and the switch is retried every 2 to 30 s. An earlier version
counted this as a power cycle, and a disturbed bus used up all three at once. Without retries, a slot stayed without
power after its bus had been stuck.

A fault keeps its first cause until a device appears in the slot, an operator switches it, or a failed switch works
again. The power stays on in a fault, because a module without power could not be detected at hot-plug. It also stays on
when the station stops, so that a restart resets no module.
A slot without an interface needs no device: if an operator has switched it on, it is `empty` and not in a fault.
"""

import logging
from collections.abc import Callable
from typing import NamedTuple

from board.runtime.errors import BlockedError, InterfaceError, StationError, StuckError
from board.runtime.journal import Journal
from board.runtime.loop import Loop, Timer
from board.slot import SequencerState, SlotSequencer
from firmware.slots.states import FAULTS, LEVELS, MEANINGS, OPERATED, Event, SlotState
from firmware.station.interface_supervisor import InterfaceSupervisor

# Number of driver failures before a power cycle. A radio or a cellular module answers about 30 s after power-on.
# Fifteen retries with their pauses take a minute, so a later failure is not caused by the start of the module.
STARTS = 15
CYCLES = 3  # number of power cycles without a steady run in between; a fourth never helped
# Seconds between retries of a failed switch: at first short, for a bus that was disturbed once; then longer, up to
# RESWITCH_S, for a bus that is stuck.
FIRST_RESWITCH_S = 2.0
RESWITCH_S = 30.0
STEADY_S = 60.0  # time with the link up after which older failures are forgotten
LOOK_S = 1.0  # least time between two checks for a steady run

log = logging.getLogger("captain.slots")


class SlotSupervisor:
    """Supervisor of one slot: its power, its device and the driver of its interface.

    sequencer  switches power and reset of the slot and detects its device. Only this class calls it.
    interface  supervisor of the interface in the slot; None if the slot has none.
    note       receives each decision for the time line: name of the slot, text.
    """

    def __init__(
        self,
        loop: Loop,
        sequencer: SlotSequencer,
        interface: InterfaceSupervisor | None,
        note: Callable[[str, str], None] = lambda who, what: None,
    ) -> None:
        self.name = sequencer.name
        self.state = SlotState.UNUSED if interface is None else SlotState.STOPPED
        self.cycles = 0
        self._loop = loop
        self._sequencer = sequencer
        self._interface = interface
        self._note = note
        self._journal = Journal(log, f"slot {self.name}", loop.clock)
        self._why = "no interface is configured for it" if interface is None else "not started"
        self._cause: StationError | None = None
        self._since = loop.clock()
        self._failures = 0  # number of driver failures since the last steady run or power cycle
        self._cycled = 0  # number of faults that led to a power cycle since the last steady run
        self._steady: Timer | None = None
        self._reswitch: Timer | None = None
        self._reswitch_s = FIRST_RESWITCH_S
        self._is_cut_pending = False  # retry of a failed switch: True cuts the power, False cycles it
        if interface is not None:
            interface.slot = self

    def start(self) -> None:
        self.dispatch(Event.START)

    def stop(self) -> None:
        """Stop the driver, leave the power unchanged, and ignore later events; a second call has no effect."""
        self.cancel_steady_run()
        self._cancel_reswitch()
        self.state = SlotState.STOPPED
        if self._interface is not None:
            self._interface.stop()

    def operate(self, word: str) -> None:
        """Execute an operator's command `on`, `off` or `cycle`, and forget earlier failures."""
        self.clear_failures()
        self.dispatch(OPERATED[word], "by an operator")

    def sequencer_changed(self) -> None:
        """Dispatch the event that follows from the new state of the sequencer. Retry a failed switch later."""
        event, transition = self._event_of_sequencer(), self._sequencer.timeline[-1]
        if event is Event.VACANT:
            self.dispatch(event)
        elif event is not None:
            self.dispatch(event, InterfaceError(transition.why, transition.hint))
        if self.state is SlotState.FAULT and self._sequencer.is_unswitched:
            self._cancel_reswitch()
            self._reswitch = self._loop.after(self._reswitch_s, self._switch_again)
            self._reswitch_s = min(RESWITCH_S, 2.0 * self._reswitch_s)

    def dispatch(self, event: Event, why: str | StationError = "") -> None:
        """Apply the rule for the current state and an event; without a rule nothing changes.

        A fault leads to a power cycle, or to Event.EXHAUSTED after CYCLES of them.

        why  reason in words, or the error that caused the event; empty: the text of the event.
        """
        error = why if isinstance(why, StationError) else InterfaceError(why or event.value)
        text = " ".join(error.message.split())
        if (self.state, event) in RULES and event in FAULTS:
            self._cause = self._cause or error
            if event is Event.UNSWITCHED:
                text += f"; tried again, at most every {RESWITCH_S:.0f} s"
            elif self._cycled < CYCLES:
                self._cycled += 1
            else:
                event = Event.EXHAUSTED
                text = f"{' '.join(self._cause.message.split())}; given up after {CYCLES} power cycles"
        rule = RULES.get((self.state, event))
        if rule is not None:
            self._enter(rule.state, text)
            for act in rule.acts:
                act(self)

    def status(self) -> dict[str, object]:
        """Return the slot's part of the status.

        title        module for which the slot is intended.
        usb          topology path of the slot's USB port.
        device       USB device in the slot; empty without a device.
        note         remark for the operator that is not a fault; may be empty.
        switched_by  means to switch the power.
        losses       number of times that the device disappeared.
        sequence     state of the sequencer: `off`, `powered`, `released`, `present` or `fault`.
        interface    interface of the slot; null if it has none.
        state        `stopped`, `unused`, `powering`, `starting`, `running`, `cycling`, `empty`, `fault` or `off`.
        since_s      seconds since the state changed.
        why          reason of the state, in words.
        cause        first fault since the last steady run of a minute; may be empty.
        hint         remedy for the cause; may be empty.
        cycles       number of power cycles since the start.
        """
        told = self._sequencer.status()
        return {
            **{key: told[key] for key in ("title", "usb", "device", "note", "switched_by", "losses")},
            "sequence": told["state"],
            "interface": self._interface.interface.name if self._interface else None,
            "state": self.state.value,
            "since_s": round(self._loop.clock() - self._since, 3),
            "why": self._why,
            "cause": self._cause.message if self._cause else "",
            "hint": self._cause.hint if self._cause else "",
            "cycles": self.cycles,
        }

    def _enter(self, state: SlotState, why: str) -> None:
        if state is self.state:
            return
        self.state, self._why, self._since = state, why, self._loop.clock()
        self._journal.say(LEVELS.get(state, logging.INFO), f"{state.value}: {why}")
        self._note(f"slot {self.name}", f"{state.value}: {why}{self._waits_for()}")

    def _waits_for(self) -> str:
        """Return a text for the time line about the device or link for which the slot waits; empty if for none."""
        described = self._sequencer.description
        if self.state is SlotState.POWERING and described.usb:
            return f"; waits for {' or '.join(described.ids) or 'a device'} at {described.usb}"
        if self.state is SlotState.RUNNING and self._interface is not None and not self._interface.interface.is_up:
            return "; waits for its link"
        return ""

    def driver_started(self) -> None:
        self.dispatch(Event.STARTED)

    def driver_failed(self, error: StationError) -> bool:
        """Count a failure of the driver. Return True if its supervisor is to retry it after the back-off.

        Return False if the slot will start it: after a power cycle, or when its device appears.
        """
        self._cause = self._cause or error
        if isinstance(error, BlockedError):
            self.dispatch(Event.FAILED, error)
            return self.state is SlotState.STARTING
        self._failures += 1
        is_stuck = isinstance(error, StuckError) or self._failures >= STARTS
        self.dispatch(Event.STUCK if is_stuck else Event.FAILED, error)
        return self.state is SlotState.STARTING

    def _event_of_sequencer(self) -> Event | None:
        """Return the event that follows from the sequencer's state; None if there is nothing to do."""
        sequencer = self._sequencer
        if sequencer.state is SequencerState.FAULT and sequencer.is_unswitched:
            return Event.UNSWITCHED
        if sequencer.state is SequencerState.FAULT and sequencer.is_empty and self._interface is None:
            return Event.VACANT
        if sequencer.state is SequencerState.OFF and sequencer.is_off_time_over:
            return Event.UNSUPPLIED
        if sequencer.state is SequencerState.RELEASED and sequencer.timeline[-2].state is SequencerState.POWERED:
            return Event.RELEASED
        return MEANINGS.get(sequencer.state)

    def _switch_again(self) -> None:
        """Retry the failed switch, because no device can appear in a slot without power."""
        if self.state is SlotState.FAULT and self._sequencer.is_unswitched:
            if self._is_cut_pending:
                self._sequencer.cut()
            else:
                self._sequencer.cycle()

    def _cancel_reswitch(self) -> None:
        if self._reswitch is not None:
            self._reswitch.cancel()

    # Actions that the rules below refer to.

    def request_power(self) -> None:
        self._is_cut_pending = False
        self._sequencer.power()

    def cut_power(self) -> None:
        self._is_cut_pending = True
        self._sequencer.cut()

    def power_cycle(self) -> None:
        """Cut the power and apply it again; forget the driver's failures."""
        self._failures = 0
        self._is_cut_pending = False
        self._sequencer.cycle()

    def count_cycle(self) -> None:
        """Count a power cycle. This is called once the power is on again, so a failed switch does not count."""
        self.cycles += 1

    def start_driver(self) -> None:
        if self._interface is None:
            self.dispatch(Event.STARTED)
        else:
            self._interface.start()

    def hold_driver(self) -> None:
        """Stop the driver and its retries."""
        self.cancel_steady_run()
        if self._interface is not None:
            self._interface.hold(f"slot {self.name}: {self.state.value}: {self._why}")

    def await_steady_run(self) -> None:
        """Dispatch Event.STEADY once the link has been up for STEADY_S; a running driver alone does not count."""
        is_up, since = True, self._since
        if self._interface is not None:
            is_up, since = self._interface.interface.is_up, self._interface.interface.since
        missing_s = STEADY_S - (self._loop.clock() - since) if is_up else STEADY_S
        if missing_s <= 0.0:
            self.dispatch(Event.STEADY)
        else:
            self._steady = self._loop.after(max(missing_s, LOOK_S), self.await_steady_run)

    def cancel_steady_run(self) -> None:
        if self._steady is not None:
            self._steady.cancel()

    def discard_driver_failures(self) -> None:
        """Forget the failures that a driver reported while its device disappeared: they are not the cause."""
        self._failures = 0
        if not self._cycled:
            self._cause = None

    def clear_failures(self) -> None:
        """Forget all failures, unsuccessful power cycles, and the cause of the fault."""
        self._failures = self._cycled = 0
        self._reswitch_s = FIRST_RESWITCH_S
        self._cause = None


class Rule(NamedTuple):
    """Rule of the state table: the next state, and the actions on entry."""

    state: SlotState
    acts: tuple[Callable[[SlotSupervisor], None], ...] = ()


_POWER = Rule(SlotState.POWERING, (SlotSupervisor.request_power,))
_OFF = Rule(SlotState.OFF, (SlotSupervisor.hold_driver, SlotSupervisor.cut_power))
_CYCLE = Rule(SlotState.CYCLING, (SlotSupervisor.hold_driver, SlotSupervisor.power_cycle))
_FAULT = Rule(SlotState.FAULT, (SlotSupervisor.hold_driver,))
_START = Rule(SlotState.STARTING, (SlotSupervisor.start_driver,))
_LOST = Rule(SlotState.POWERING, (SlotSupervisor.hold_driver, SlotSupervisor.discard_driver_failures))

RULES: dict[tuple[SlotState, Event], Rule] = {
    (SlotState.STOPPED, Event.START): _POWER,
    (SlotState.UNUSED, Event.ON): _POWER,
    (SlotState.UNUSED, Event.OFF): _OFF,
    (SlotState.UNUSED, Event.CYCLE): _CYCLE,
    (SlotState.OFF, Event.ON): _POWER,
    (SlotState.OFF, Event.CYCLE): _POWER,
    (SlotState.OFF, Event.UNSWITCHED): _FAULT,
    (SlotState.POWERING, Event.PLUGGED): _START,
    (SlotState.POWERING, Event.ABSENT): _CYCLE,
    (SlotState.POWERING, Event.VACANT): Rule(SlotState.EMPTY),
    (SlotState.POWERING, Event.EXHAUSTED): _FAULT,
    (SlotState.POWERING, Event.UNSWITCHED): _FAULT,
    (SlotState.POWERING, Event.OFF): _OFF,
    (SlotState.POWERING, Event.CYCLE): _CYCLE,
    (SlotState.STARTING, Event.STARTED): Rule(SlotState.RUNNING, (SlotSupervisor.await_steady_run,)),
    (SlotState.STARTING, Event.UNPLUGGED): _LOST,
    (SlotState.STARTING, Event.ABSENT): _CYCLE,
    (SlotState.STARTING, Event.STUCK): _CYCLE,
    (SlotState.STARTING, Event.EXHAUSTED): _FAULT,
    (SlotState.STARTING, Event.OFF): _OFF,
    (SlotState.STARTING, Event.CYCLE): _CYCLE,
    (SlotState.RUNNING, Event.FAILED): Rule(SlotState.STARTING, (SlotSupervisor.cancel_steady_run,)),
    (SlotState.RUNNING, Event.STEADY): Rule(SlotState.RUNNING, (SlotSupervisor.clear_failures,)),
    (SlotState.RUNNING, Event.UNPLUGGED): _LOST,
    (SlotState.RUNNING, Event.ABSENT): _CYCLE,
    (SlotState.RUNNING, Event.STUCK): _CYCLE,
    (SlotState.RUNNING, Event.EXHAUSTED): _FAULT,
    (SlotState.RUNNING, Event.OFF): _OFF,
    (SlotState.RUNNING, Event.CYCLE): _CYCLE,
    (SlotState.CYCLING, Event.SUPPLIED): Rule(SlotState.POWERING, (SlotSupervisor.count_cycle,)),
    (SlotState.CYCLING, Event.UNSWITCHED): _FAULT,
    (SlotState.CYCLING, Event.OFF): _OFF,
    (SlotState.CYCLING, Event.CYCLE): Rule(SlotState.CYCLING, (SlotSupervisor.power_cycle,)),
    (SlotState.EMPTY, Event.PLUGGED): _START,
    (SlotState.EMPTY, Event.OFF): _OFF,
    (SlotState.EMPTY, Event.CYCLE): _CYCLE,
    (SlotState.FAULT, Event.PLUGGED): Rule(
        SlotState.STARTING, (SlotSupervisor.clear_failures, SlotSupervisor.start_driver)
    ),
    # In a fault, these events come only from _switch_again(): the failed switch works again.
    (SlotState.FAULT, Event.RELEASED): Rule(SlotState.POWERING, (SlotSupervisor.clear_failures,)),
    (SlotState.FAULT, Event.UNSUPPLIED): Rule(SlotState.OFF, (SlotSupervisor.clear_failures,)),
    (SlotState.FAULT, Event.ON): _CYCLE,
    (SlotState.FAULT, Event.OFF): _OFF,
    (SlotState.FAULT, Event.CYCLE): _CYCLE,
}
