"""One slot's life: power, device, driver; when starting alone does not help a power cycle, and at last a fault.

        start             device              driver runs
    ──────────> powering ────────> starting ─────────────> running
                 │    ^             │   ^      fails          │
           absent│    │device gone  │   └────────────────────┘
                 v    └─────────────┤stuck
               cycling <────────────┘           CYCLES without steady running ──> fault
                                                hot-plug, operator: fault ──> from the beginning

A fault stays, with its first cause, until something has changed: a device appears in the slot, or an operator asks.
The power stays on in a fault, because a module without power could not be seen when it is plugged in; it stays on when
the station stops, so that a restart of the station is none of its modules.
"""

import logging
from collections.abc import Callable
from enum import StrEnum
from typing import NamedTuple, Protocol

from board.errors import StationError, StuckError
from board.loop import Loop, Timer
from firmware.journal import Journal
from firmware.supervisor import Supervised

# A radio answers about 30 s after its power came, a cellular module after as long. Fifteen tries with their pauses take
# a minute: what has failed for so long fails for another reason.
STARTS = 15
CYCLES = 3  # without steady running in between; a fourth has never helped
STEADY_S = 60.0  # of running, after which an older failure has nothing to do with the next

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
    ABSENT = "no device"  # in time, or its power could not be switched
    UNPOWERED = "without power for long enough"
    STARTED = "driver started"
    FAILED = "driver failed"
    STUCK = "driver failed too often, or for good"
    EXHAUSTED = "power cycles do not help"  # in place of ABSENT and STUCK
    STEADY = "ran steadily"


OPERATED = {"on": Event.ON, "off": Event.OFF, "cycle": Event.CYCLE}

# Of a driver that starts again the interface's own supervisor has said why.
LEVELS = {State.STARTING: logging.DEBUG, State.CYCLING: logging.WARNING, State.FAULT: logging.ERROR}


class Power(Protocol):
    """What is asked of board.slot.Slot."""

    @property
    def state(self) -> str: ...

    def power(self) -> None:
        """Switch it on and look for its device."""

    def cut(self) -> None:
        """Switch it off for at least off_s."""


class Slot:
    """Supervises what sits in one slot.

    name       in the board file; title  what is meant to sit in it.
    power      the only thing that switches it.
    interface  that it carries; None where none does.
    noted      told of every decision, for the time line.
    """

    def __init__(
        self,
        loop: Loop,
        name: str,
        title: str,
        power: Power,
        interface: Supervised | None,
        noted: Callable[[str, str], None] = lambda who, what: None,
    ) -> None:
        self.name = name
        self.state = State.UNUSED if interface is None else State.STOPPED
        self.cycles = 0
        self._loop = loop
        self._title = title
        self._power = power
        self._interface = interface
        self._noted = noted
        self._journal = Journal(log, loop.clock)
        self._why = "no interface is configured for it" if interface is None else "not started"
        self._cause = ""
        self._since = loop.clock()
        self._failures = 0  # since it last ran steadily
        self._cycled = 0  # likewise
        self._steady: Timer | None = None
        if interface is not None:
            interface.on_start = lambda: self.tell(Event.STARTED)
            interface.on_failure = self._failed

    def start(self) -> None:
        self.tell(Event.START)

    def stop(self) -> None:
        """Stop the driver, leave the power as it is, and do nothing more whatever happens; idempotent."""
        self.unwatch()
        self.state = State.STOPPED
        if self._interface is not None:
            self._interface.stop()

    def operate(self, word: str) -> None:
        """`on`, `off` or `cycle`: what has gone wrong before is forgotten."""
        self.forgive()
        self.tell(OPERATED[word], "by an operator")

    def tell(self, event: Event, why: str = "") -> None:
        """What has happened; an event that the state has no rule for changes nothing."""
        if event in (Event.ABSENT, Event.STUCK):
            self._cause = self._cause or why or event.value
            if self._cycled >= CYCLES:
                event = Event.EXHAUSTED
        rule = RULES.get((self.state, event))
        if rule is None:
            return
        self._enter(rule.state, why or event.value)
        for act in rule.acts:
            act(self)

    def status(self) -> dict[str, object]:
        return {
            "title": self._title,
            "state": self.state.value,
            "since_s": round(self._loop.clock() - self._since, 3),
            "why": self._why,
            "cause": self._cause,
            "cycles": self.cycles,
            "power": str(self._power.state),
            "interface": self._interface.interface.name if self._interface else None,
        }

    def _enter(self, state: State, why: str) -> None:
        if state is self.state:
            return
        if state is State.FAULT:
            why = f"{self._cause}; given up after {CYCLES} power cycles"
        self.state, self._why, self._since = state, why, self._loop.clock()
        self._journal.say(LEVELS.get(state, logging.INFO), "slot %s: %s: %s", self.name, state.value, why)
        self._noted(f"slot {self.name}", f"{state.value}: {why}")

    def _failed(self, error: StationError) -> bool:
        """Whether the driver is to be started again, the device being there and nothing else to be tried first."""
        self._cause = self._cause or error.message
        self._failures += 1
        is_stuck = isinstance(error, StuckError) or self._failures >= STARTS
        self.tell(Event.STUCK if is_stuck else Event.FAILED, error.message)
        return self.state is State.STARTING

    # What the rules do, in their order.

    def supply(self) -> None:
        self._power.power()

    def cut(self) -> None:
        if self.state is State.CYCLING:
            self.cycles += 1
            self._cycled += 1
            self._failures = 0
        self._power.cut()

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
        self._steady = self._loop.after(STEADY_S, lambda: self.tell(Event.STEADY))

    def unwatch(self) -> None:
        if self._steady is not None:
            self._steady.cancel()

    def forgive(self) -> None:
        self._failures = self._cycled = 0
        self._cause = ""


class Rule(NamedTuple):
    """The state that follows, and what is done in it."""

    state: State
    acts: tuple[Callable[[Slot], None], ...] = ()


_POWER = Rule(State.POWERING, (Slot.supply,))
_OFF = Rule(State.OFF, (Slot.hold, Slot.cut))
_CYCLE = Rule(State.CYCLING, (Slot.hold, Slot.cut))
_FAULT = Rule(State.FAULT, (Slot.hold,))
_LAUNCH = Rule(State.STARTING, (Slot.launch,))
_AWAIT = Rule(State.POWERING, (Slot.hold,))

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
    (State.STARTING, Event.STUCK): _CYCLE,
    (State.STARTING, Event.EXHAUSTED): _FAULT,
    (State.STARTING, Event.OFF): _OFF,
    (State.STARTING, Event.CYCLE): _CYCLE,
    (State.RUNNING, Event.FAILED): Rule(State.STARTING, (Slot.unwatch,)),
    (State.RUNNING, Event.STEADY): Rule(State.RUNNING, (Slot.forgive,)),
    (State.RUNNING, Event.UNPLUGGED): _AWAIT,
    (State.RUNNING, Event.STUCK): _CYCLE,
    (State.RUNNING, Event.EXHAUSTED): _FAULT,
    (State.RUNNING, Event.OFF): _OFF,
    (State.RUNNING, Event.CYCLE): _CYCLE,
    (State.CYCLING, Event.UNPOWERED): _POWER,
    (State.CYCLING, Event.ABSENT): _CYCLE,
    (State.CYCLING, Event.EXHAUSTED): _FAULT,
    (State.CYCLING, Event.OFF): _OFF,
    (State.FAULT, Event.PLUGGED): Rule(State.STARTING, (Slot.forgive, Slot.launch)),
    (State.FAULT, Event.ON): _POWER,
    (State.FAULT, Event.OFF): _OFF,
    (State.FAULT, Event.CYCLE): _CYCLE,
}
