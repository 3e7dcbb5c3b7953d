"""One slot's life: power, device, driver; when starting alone does not help a power cycle, and at last a fault.

        start             device              driver runs
    ──────────> powering ────────> starting ─────────────> running
                 │    ^             │   ^      fails          │
           absent│    │device gone  │   └────────────────────┘
                 v    └─────────────┤stuck
               cycling <────────────┘           CYCLES without steady running ──> fault
                                                hot-plug, operator: fault ──> from the beginning

A slot that no interface has, and that an operator has switched on, is empty when nothing is plugged in: no fault, and
no power cycle, which are for a device that somebody misses. It then waits for one.

A fault stays, with its first cause, until something has changed: a device appears in the slot, or an operator asks.
The power stays on in a fault, because a module without power could not be seen when it is plugged in; where it could
not be switched, that is tried again, and no power cycle. It stays on when the station stops, so that a restart of the
station is none of its modules.
"""

import logging
from collections.abc import Callable
from typing import NamedTuple

from board.errors import BlockedError, InterfaceError, StationError, StuckError
from board.journal import Journal
from board.loop import Loop, Timer
from board.slot import Slot as Sequencer
from board.slot import State as Sequence
from firmware.slot_states import FAULTS, LEVELS, MEANINGS, OPERATED, Event, State
from firmware.supervisor import Supervised

# A radio answers about 30 s after its power came, a cellular module after as long. Fifteen tries with their pauses take
# a minute: what has failed for so long fails for another reason.
STARTS = 15
CYCLES = 3  # without steady running in between; a fourth has never helped
# Between two tries of a switch that has failed: a bus that was disturbed once is soon tried, one that is stuck seldom.
FIRST_RESWITCH_S = 2.0
RESWITCH_S = 30.0
STEADY_S = 60.0  # with its link up, after which an older failure has nothing to do with the next
LOOK_S = 1.0  # at least, between two looks at how long its link has been up

log = logging.getLogger("captain.slots")


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
        self._journal = Journal(log, f"slot {self.name}", loop.clock)
        self._why = "no interface is configured for it" if interface is None else "not started"
        self._cause: StationError | None = None
        self._since = loop.clock()
        self._failures = 0  # since it last ran steadily
        self._cycled = 0  # likewise
        self._steady: Timer | None = None
        self._reswitch: Timer | None = None
        self._reswitch_s = FIRST_RESWITCH_S
        self._again = sequencer.cycle  # what is tried again
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
        event, passage = self._meaning(), self._sequencer.timeline[-1]
        if event is Event.VACANT:
            self.tell(event)
        elif event is not None:
            self.tell(event, InterfaceError(passage.why, passage.hint))
        if self.state is State.FAULT and self._sequencer.is_unswitched:
            self._leave_switches()
            self._reswitch = self._loop.after(self._reswitch_s, self._switch_again)
            self._reswitch_s = min(RESWITCH_S, 2.0 * self._reswitch_s)

    def tell(self, event: Event, why: str | StationError = "") -> None:
        """What has happened; an event that the state has no rule for changes nothing."""
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
        """As JSON; what the sequencer says of its switches and its device is in it."""
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

    def _enter(self, state: State, why: str) -> None:
        if state is self.state:
            return
        self.state, self._why, self._since = state, why, self._loop.clock()
        self._journal.say(LEVELS.get(state, logging.INFO), f"{state.value}: {why}")
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
        self._cause = self._cause or error
        if isinstance(error, BlockedError):
            self.tell(Event.FAILED, error)
            return self.state is State.STARTING
        self._failures += 1
        is_stuck = isinstance(error, StuckError) or self._failures >= STARTS
        self.tell(Event.STUCK if is_stuck else Event.FAILED, error)
        return self.state is State.STARTING

    def _meaning(self) -> Event | None:
        """Of what the sequencer has entered."""
        sequencer = self._sequencer
        if sequencer.state is Sequence.FAULT and sequencer.is_unswitched:
            return Event.UNSWITCHED
        if sequencer.state is Sequence.FAULT and sequencer.is_empty and self._interface is None:
            return Event.VACANT
        if sequencer.state is Sequence.OFF and sequencer.is_rested:
            return Event.UNSUPPLIED
        if sequencer.state is Sequence.RELEASED and sequencer.timeline[-2].state is Sequence.POWERED:
            return Event.RELEASED
        return MEANINGS.get(sequencer.state)

    def _switch_again(self) -> None:
        """Nothing could show itself in a slot without power, and the fault would be there for ever."""
        if self.state is State.FAULT and self._sequencer.is_unswitched:
            self._again()

    def _leave_switches(self) -> None:
        if self._reswitch is not None:
            self._reswitch.cancel()

    # What the rules do, in their order.

    def supply(self) -> None:
        self._again = self._sequencer.cycle
        self._sequencer.power()

    def cut(self) -> None:
        self._again = self._sequencer.cut
        self._sequencer.cut()

    def cycle(self) -> None:
        self._failures = 0
        self._again = self._sequencer.cycle
        self._sequencer.cycle()

    def count(self) -> None:
        """It was without power: one whose switch failed is no power cycle."""
        self.cycles += 1

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
            self._cause = None

    def forgive(self) -> None:
        self._failures = self._cycled = 0
        self._reswitch_s = FIRST_RESWITCH_S
        self._cause = None


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
    (State.OFF, Event.UNSWITCHED): _FAULT,
    (State.POWERING, Event.PLUGGED): _LAUNCH,
    (State.POWERING, Event.ABSENT): _CYCLE,
    (State.POWERING, Event.VACANT): Rule(State.EMPTY),
    (State.POWERING, Event.EXHAUSTED): _FAULT,
    (State.POWERING, Event.UNSWITCHED): _FAULT,
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
    (State.CYCLING, Event.SUPPLIED): Rule(State.POWERING, (Slot.count,)),
    (State.CYCLING, Event.UNSWITCHED): _FAULT,
    (State.CYCLING, Event.OFF): _OFF,
    (State.CYCLING, Event.CYCLE): Rule(State.CYCLING, (Slot.cycle,)),
    (State.EMPTY, Event.PLUGGED): _LAUNCH,
    (State.EMPTY, Event.OFF): _OFF,
    (State.EMPTY, Event.CYCLE): _CYCLE,
    (State.FAULT, Event.PLUGGED): Rule(State.STARTING, (Slot.forgive, Slot.launch)),
    # Its switches obey again: in a fault nobody else has them tried.
    (State.FAULT, Event.RELEASED): Rule(State.POWERING, (Slot.forgive,)),
    (State.FAULT, Event.UNSUPPLIED): Rule(State.OFF, (Slot.forgive,)),
    (State.FAULT, Event.ON): _CYCLE,
    (State.FAULT, Event.OFF): _OFF,
    (State.FAULT, Event.CYCLE): _CYCLE,
}
