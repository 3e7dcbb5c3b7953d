"""Parts that fail repeatedly: a module in its slot, or the buses."""

import random
from collections.abc import Callable, Sequence
from enum import Enum, auto
from typing import NamedTuple, Protocol

from drivers.sim.trouble import BOARD

PULLED_S = 1.0  # that who clears a fault needs to pull a module out and put it back


# Beside what drivers/sim/trouble.py has: somebody kills the board's worker process.
WORKER = f"{BOARD} worker"


class Pace(NamedTuple):
    """How troubles follow each other.

    mean_s, longest_s  of a trouble; share_long of them are the longest.
    gap_s              on average, from being back to the next trouble.
    share_again        of troubles that are followed by another one before the module is back.
    """

    mean_s: float
    longest_s: float
    share_long: float
    gap_s: float
    share_again: float


# The longest is one that power cycles cannot outlast: the slot gives up.
LIVELY = Pace(8.0, 100.0, 0.07, 12.0, 0.25)
QUICK = Pace(2.0, 4.0, 0.0, 3.0, 0.1)


class Theatre(Protocol):
    """Where it happens: a station in this process or in one of its own."""

    def now(self) -> float: ...
    def obey(self, text: str) -> None:
        """As drivers/sim/trouble.py has it; and `begin` WORKER."""

    def is_up(self, name: str) -> bool:
        """Whether all of a module works, or of the board."""

    def is_in_fault(self, name: str) -> bool:
        """Whether its slot is in a fault that stays."""


class Episode(NamedTuple):
    """From the first trouble until it was back.

    at_s      since the start of the run.
    troubles  one after the other.
    down_s    that it did not work, in all.
    back_s    from the end of the last trouble, or from when it was put back into its slot for a fault that stays.
    replugs   how often that was done.
    limit_s   for back_s.
    """

    at_s: float
    name: str
    troubles: str
    lasted_s: float
    down_s: float
    back_s: float
    replugs: int
    limit_s: float

    @property
    def is_ok(self) -> bool:
        return self.back_s <= self.limit_s


class Phase(Enum):
    WELL = auto()
    ILL = auto()  # trouble lasts
    PULLED = auto()  # out of its slot, to clear a fault
    RECOVERING = auto()


class Patient:
    """One of them.

    words     what can go wrong with it.
    limit_s   within which it has to be back; switch_s is added where a switch of its slot may have failed.
    settle_s  that it has to be up, before it counts as back: some troubles are seen later.
    is_disturbed  whether its switches may fail: its time begins after that.
    unexplained   moments at which it was down without trouble.
    """

    def __init__(
        self,
        theatre: Theatre,
        name: str,
        words: Sequence[str],
        limit_s: float,
        settle_s: float,
        chance: random.Random,
        is_disturbed: Callable[[], bool] = lambda: False,
        switch_s: float = 0.0,
        pace: Pace = LIVELY,
    ) -> None:
        self.name = name
        self.phase = Phase.WELL
        self.episodes: list[Episode] = []
        self.unexplained: list[float] = []
        self.is_over = False  # no further trouble
        self._theatre = theatre
        self._words = words
        self._limits_s = limit_s, switch_s
        self._settle_s = settle_s
        self._chance = chance
        self._is_disturbed = is_disturbed
        self._pace = pace
        self._began = theatre.now()
        self._until = self._began + chance.expovariate(1 / pace.gap_s)

    def tick(self) -> None:
        """Look at it, and do what is due; several times a second."""
        now = self._theatre.now()
        is_up = self._theatre.is_up(self.name)
        if self.phase is Phase.WELL:
            self._well(now, is_up)
            return
        if not is_up:
            self._down_s += now - self._looked
            self._up_since = None
        elif self._up_since is None:
            self._up_since = now
        self._looked = now
        if self._is_disturbed():
            self._limit_s = sum(self._limits_s)
        if self.phase is Phase.ILL and now >= self._until:
            self._end(now)
        elif self.phase is Phase.PULLED and now >= self._until:
            self._theatre.obey(f"end {self.name} unplugged")
            self.phase, self._ended, self._replugged = Phase.RECOVERING, now, now
        elif self.phase is Phase.RECOVERING:
            self._recover(now)

    @property
    def overdue(self) -> str:
        """That it is not back in time; empty when all is well."""
        if self.phase is not Phase.RECOVERING or self._theatre.now() - self._ended <= self._limit_s + self._settle_s:
            return ""
        return f"{self.name} is not back {self._limit_s:.0f} s after {', '.join(self._troubles)}"

    def _well(self, now: float, is_up: bool) -> None:
        if not is_up:
            self.unexplained.append(now - self._began)
            self._fall(now)
            self._troubles.append("nothing")
            self.phase, self._ended = Phase.RECOVERING, now
        elif now >= self._until and not self.is_over:
            self._fall(now)
            self._begin(now)

    def _fall(self, now: float) -> None:
        self._troubles: list[str] = []
        self._first = self._looked = now
        self._limit_s = self._limits_s[0]
        self._down_s = 0.0
        self._up_since: float | None = now
        self._replugs = 0
        self._replugged = float("-inf")

    def _begin(self, now: float) -> None:
        word = self._chance.choice(self._words)
        self._troubles.append(word)
        self._theatre.obey(f"begin {self.name} {word}")
        pace = self._pace
        is_long = self._chance.random() < pace.share_long
        drawn = self._chance.expovariate(1 / pace.mean_s)
        self._until = now + (pace.longest_s if is_long else min(pace.longest_s, drawn))
        self.phase = Phase.ILL

    def _end(self, now: float) -> None:
        self._theatre.obey(f"end {self.name} {self._troubles[-1]}")
        self.phase, self._ended = Phase.RECOVERING, now
        if not self.is_over and self._chance.random() < self._pace.share_again:
            self._begin(now)

    def _recover(self, now: float) -> None:
        if self._is_disturbed() and self._up_since is None:
            self._ended = now
        elif self._theatre.is_in_fault(self.name) and now - self._replugged > self._limit_s:
            self._theatre.obey(f"begin {self.name} unplugged")
            self._replugs += 1
            self.phase, self._until = Phase.PULLED, now + PULLED_S
        elif self._up_since is not None and now - max(self._up_since, self._ended) >= self._settle_s:
            back_s = max(0.0, self._up_since - self._ended)
            self.episodes.append(
                Episode(
                    self._first - self._began,
                    self.name,
                    ", ".join(self._troubles),
                    self._ended - self._first,
                    self._down_s,
                    back_s,
                    self._replugs,
                    self._limit_s,
                )
            )
            self.phase = Phase.WELL
            self._until = now + self._chance.expovariate(1 / self._pace.gap_s)
