"""One slot's life: power, device, driver; when starting alone does not help a power cycle, and at last a fault.

        start             device              driver runs
    ──────────> powering ────────> starting ─────────────> running
                 │    ^             │   ^      fails          │
           absent│    │device gone  │   └────────────────────┘
                 v    └─────────────┤stuck
               cycling <────────────┘           CYCLES without steady running ──> fault
                                                hot-plug, operator: fault ──> from the beginning

A fault stays, with its first cause, until something has changed: a device appears in the slot, or an operator asks.
The power stays on in a fault, because a module without power could not be seen when it is plugged in; where it could
not be switched on, that is tried again. It stays on when the station stops, so that a restart of the station is none of
its modules.
"""

import logging
from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple

from board.errors import BlockedError, StationError, StuckError
from board.loop import Loop, Timer
from board.slot import Slot as Sequencer
from board.slot import State as Sequence
from firmware.journal import Journal
from firmware.supervisor import Supervised

# A radio answers about 30 s after its power came, a cellular module after as long. Fifteen tries with their pauses take
# a minute: what has failed for so long fails for another reason.
STARTS = 15
CYCLES = 3  # without steady running in between; a fourth has never helped
RESWITCH_S = 30.0  # between two tries to give power to a slot in fault, after a switch has failed
STEADY_S = 60.0  # with its link up, after which an older failure has nothing to do with the next
LOOK_S = 1.0  # at least, between two looks at how long its link has been up

log = logging.getLogger("captain.slots")


class State(StrEnum):
    """Of a slot, as in the status."""

    STOPPED = "stopped"  # the station has not started, or is ending
    UNUSED = "unused"  # no interface has it, its power is left as it was found
    OFF = "off"  # an operator has switched it off
    POWERING = "powering"  # power is on, its device is waited for
    STARTING = "starting"  # its device is there, its driver is being started, if need be again and again
    RUNNING = "running"
    CYCLING = "cycling"  # without power for a moment
    FAULT = "fault"


class Event(StrEnum):
    """What happens to a slot."""

    START = "the station has started"
    ON = "switched on"
    OFF = "switched off"
    CYCLE = "power cycle"
    PLUGGED = "device seen"
    UNPLUGGED = "device gone"
    ABSENT = "no device"  # in time, or it went too often, or its power could not be switched
    SUPPLIED = "power is on"
    STARTED = "driver started"
    FAILED = "driver failed"
    STUCK = "driver failed too often, or for good"
    EXHAUSTED = "power cycles do not help"  # in place of ABSENT and STUCK
    STEADY = "ran steadily"


# What a state of the sequencer means here.
MEANINGS = {
    Sequence.POWERED: Event.SUPPLIED,
    Sequence.RELEASED: Event.UNPLUGGED,
    Sequence.PRESENT: Event.PLUGGED,
    Sequence.FAULT: Event.ABSENT,
}
OPERATED = {"on": Event.ON, "off": Event.OFF, "cycle": Event.CYCLE}

# Of a driver that starts again the interface's own supervisor has said why.
LEVELS = {State.STARTING: logging.DEBUG, State.CYCLING: logging.WARNING, State.FAULT: logging.ERROR}


class Slot:
    """Supervises what sits in one slot.

    sequencer  switches it, and sees its device; nobody else tells it to.
    interface  that the slot carries; None where none does.
    noted      told of every decision, for the time line.
    """

    def __init__(
        self,
        loop: Loop,
        sequencer: Sequencer,
        interface: Supervised | None,
        noted: Callable[[str, str], None] = lambda who, what: None,
    ) -> None:
        self.name = sequencer.name
        self.state = State.UNUSED if interface is None else State.STOPPED
        self.cycles = 0
        self._loop = loop
        self._sequencer = sequencer
        self._interface = interface
        self._noted = noted
        self._journal = Journal(log, loop.clock)
        self._why = "no interface is configured for it" if interface is None else "not started"
        self._cause = ""
        self._since = loop.clock()
        self._failures = 0  # since it last ran steadily
        self._cycled = 0  # likewise
        self._steady: Timer | None = None
        self._reswitch: Timer | None = None
        if interface is not None:
            interface.on_start = lambda: self.tell(Event.STARTED)
            interface.on_failure = self._failed

    def start(self) -> None:
        self.tell(Event.START)

    def stop(self) -> None:
        """Stop the driver, leave the power as it is, and do nothing more whatever happens; idempotent."""
        self.unwatch()
        self._leave_switches()
        self.state = State.STOPPED
        if self._interface is not None:
            self._interface.stop()

    def operate(self, word: str) -> None:
        """`on`, `off` or `cycle`: what has gone wrong before is forgotten."""
        self.forgive()
        self.tell(OPERATED[word], "by an operator")

    def changed(self) -> None:
        """The sequencer has entered another state."""
        passage = self._sequencer.timeline[-1]
        if self._sequencer.state in MEANINGS:
            self.tell(MEANINGS[self._sequencer.state], passage.why)
        if self.state is State.FAULT and self._sequencer.is_unswitched:
            self._leave_switches()
            self._reswitch = self._loop.after(RESWITCH_S, self._switch_again)

    def tell(self, event: Event, why: str = "") -> None:
        """What has happened; an event that the state has no rule for changes nothing."""
        why = " ".join((why or event.value).split())
        if (self.state, event) in RULES and event in (Event.ABSENT, Event.STUCK):
            self._cause = self._cause or why
            event = event if self._cycled < CYCLES else Event.EXHAUSTED
            self._cycled += 1
        rule = RULES.get((self.state, event))
        if rule is not None:
            self._enter(rule.state, why)
            for act in rule.acts:
                act(self)

    def status(self) -> dict[str, object]:
        """As JSON; what the sequencer says of its switches and its device is in it."""
        told = self._sequencer.status()
        return {
            **{key: told[key] for key in ("title", "usb", "device", "note", "switched_by", "losses")},
            "sequence": told["state"],
            "interface": self._interface.interface.name if self._interface else None,
            "state": self.state.value,
            "since_s": round(self._loop.clock() - self._since, 3),
            "why": self._why,
            "cause": self._cause,
            "cycles": self.cycles,
        }

    def _enter(self, state: State, why: str) -> None:
        if state is self.state:
            return
        if state is State.FAULT:
            why = f"{self._cause}; given up after {CYCLES} power cycles"
        self.state, self._why, self._since = state, why, self._loop.clock()
        self._journal.say(LEVELS.get(state, logging.INFO), "slot %s: %s: %s", self.name, state.value, why)
        self._noted(f"slot {self.name}", f"{state.value}: {why}{self._awaited()}")

    def _awaited(self) -> str:
        """What it waits for now, for the time line."""
        described = self._sequencer.description
        if self.state is State.POWERING and described.usb:
            return f"; waits for {' or '.join(described.ids) or 'a device'} at {described.usb}"
        if self.state is State.RUNNING and self._interface is not None and not self._interface.interface.is_up:
            return "; waits for its link"
        return ""

    def _failed(self, error: StationError) -> bool:
        """Whether the driver is to be started again, the device being there and nothing else to be tried first."""
        self._cause = self._cause or error.message
        if isinstance(error, BlockedError):
            self.tell(Event.FAILED, error.message)
            return self.state is State.STARTING
        self._failures += 1
        is_stuck = isinstance(error, StuckError) or self._failures >= STARTS
        self.tell(Event.STUCK if is_stuck else Event.FAILED, error.message)
        return self.state is State.STARTING

    def _switch_again(self) -> None:
        """Nothing could show itself in a slot without power, and the fault would be there for ever."""
        if self.state is State.FAULT and self._sequencer.is_unswitched:
            self._sequencer.cycle()

    def _leave_switches(self) -> None:
        if self._reswitch is not None:
            self._reswitch.cancel()

    # What the rules do, in their order.

    def supply(self) -> None:
        self._sequencer.power()

    def cut(self) -> None:
        self._sequencer.cut()

    def cycle(self) -> None:
        self.cycles += 1
        self._failures = 0
        self._sequencer.cycle()

    def launch(self) -> None:
        if self._interface is None:
            self.tell(Event.STARTED)
        else:
            self._interface.start()

    def hold(self) -> None:
        """No driver runs or is tried."""
        self.unwatch()
        if self._interface is not None:
            self._interface.hold(f"slot {self.name}: {self.state.value}: {self._why}")

    def watch(self) -> None:
        """A driver that runs says nothing of its module: the time counts from when its link came up."""
        is_up, since = True, self._since
        if self._interface is not None:
            is_up, since = self._interface.interface.is_up, self._interface.interface.since
        missing_s = STEADY_S - (self._loop.clock() - since) if is_up else STEADY_S
        if missing_s <= 0.0:
            self.tell(Event.STEADY)
        else:
            self._steady = self._loop.after(max(missing_s, LOOK_S), self.watch)

    def unwatch(self) -> None:
        if self._steady is not None:
            self._steady.cancel()

    def excuse(self) -> None:
        """What its driver said of a device that was just leaving is not why it is gone."""
        self._failures = 0
        if not self._cycled:
            self._cause = ""

    def forgive(self) -> None:
        self._failures = self._cycled = 0
        self._cause = ""


class Rule(NamedTuple):
    """The state that follows, and what is done in it."""

    state: State
    acts: tuple[Callable[[Slot], None], ...] = ()


_POWER = Rule(State.POWERING, (Slot.supply,))
_OFF = Rule(State.OFF, (Slot.hold, Slot.cut))
_CYCLE = Rule(State.CYCLING, (Slot.hold, Slot.cycle))
_FAULT = Rule(State.FAULT, (Slot.hold,))
_LAUNCH = Rule(State.STARTING, (Slot.launch,))
_AWAIT = Rule(State.POWERING, (Slot.hold, Slot.excuse))

RULES: dict[tuple[State, Event], Rule] = {
    (State.STOPPED, Event.START): _POWER,
    (State.UNUSED, Event.ON): _POWER,
    (State.UNUSED, Event.OFF): _OFF,
    (State.UNUSED, Event.CYCLE): _CYCLE,
    (State.OFF, Event.ON): _POWER,
    (State.OFF, Event.CYCLE): _POWER,
    (State.POWERING, Event.PLUGGED): _LAUNCH,
    (State.POWERING, Event.ABSENT): _CYCLE,
    (State.POWERING, Event.EXHAUSTED): _FAULT,
    (State.POWERING, Event.OFF): _OFF,
    (State.POWERING, Event.CYCLE): _CYCLE,
    (State.STARTING, Event.STARTED): Rule(State.RUNNING, (Slot.watch,)),
    (State.STARTING, Event.UNPLUGGED): _AWAIT,
    (State.STARTING, Event.ABSENT): _CYCLE,
    (State.STARTING, Event.STUCK): _CYCLE,
    (State.STARTING, Event.EXHAUSTED): _FAULT,
    (State.STARTING, Event.OFF): _OFF,
    (State.STARTING, Event.CYCLE): _CYCLE,
    (State.RUNNING, Event.FAILED): Rule(State.STARTING, (Slot.unwatch,)),
    (State.RUNNING, Event.STEADY): Rule(State.RUNNING, (Slot.forgive,)),
    (State.RUNNING, Event.UNPLUGGED): _AWAIT,
    (State.RUNNING, Event.ABSENT): _CYCLE,
    (State.RUNNING, Event.STUCK): _CYCLE,
    (State.RUNNING, Event.EXHAUSTED): _FAULT,
    (State.RUNNING, Event.OFF): _OFF,
    (State.RUNNING, Event.CYCLE): _CYCLE,
    (State.CYCLING, Event.SUPPLIED): Rule(State.POWERING),
    (State.CYCLING, Event.ABSENT): _CYCLE,
    (State.CYCLING, Event.EXHAUSTED): _FAULT,
    (State.CYCLING, Event.OFF): _OFF,
    (State.FAULT, Event.PLUGGED): Rule(State.STARTING, (Slot.forgive, Slot.launch)),
    (State.FAULT, Event.ON): _CYCLE,
    (State.FAULT, Event.OFF): _OFF,
    (State.FAULT, Event.CYCLE): _CYCLE,
}
