"""Plays what is recorded: each when its time has come, rewritten, through a bad way, out by one end."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from board.errors import RequestError
from drivers.wire.impairment import Impairment
from firmware.codec.reading import Pdu
from firmware.replay.ends import End
from firmware.replay.reasons import count
from firmware.replay.rewriting import Rewriting
from firmware.replay.timing import Schedule, Timing


@dataclass
class Played:
    """What became of everything. What the way did is in its own counts.

    read        messages and frames. unreadable: what was neither.
    left_out    of those read, by why.
    sent        copies that the way made among them. unsent: what could not be sent, by why.
    late_s      the longest that one was sent after it was due.
    gaps_cut    where the recording was longer silent than is replayed, or its clock was set.
    examples    of each reason, where the first stands.
    """

    read: int = 0
    unreadable: int = 0
    left_out: Counter[str] = field(default_factory=Counter)
    sent: int = 0
    unsent: Counter[str] = field(default_factory=Counter)
    late_s: float = 0.0
    gaps_cut: int = 0
    examples: dict[str, str] = field(default_factory=dict)

    @property
    def is_good(self) -> bool:
        """Whether everything could be read, and what was to go could go: anything at all."""
        return self.read > self.left_out.total() and not self.unreadable and not self.unsent


class Player:
    """Plays rounds.

    tell   hears of what cannot be read.
    clock  monotonic seconds; wall: Unix time in ns.
    """

    def __init__(
        self,
        end: End,
        way: Impairment[Pdu],
        rewriting: Rewriting,
        timing: Timing,
        tell: Callable[[RequestError], None],
        clock: Callable[[], float] = time.monotonic,
        wall: Callable[[], int] = time.time_ns,
    ) -> None:
        self.played = Played()
        self._end = end
        self._way = way
        self._rewriting = rewriting
        self._timing = timing
        self._tell = tell
        self._clock = clock
        self._wall = wall
        self._begin: float | None = None

    def play(self, items: Iterable[Pdu | RequestError]) -> Iterator[int]:
        """A round; another one begins where it ends. Yields how many have been read, of what goes."""
        schedule = Schedule(self._timing)
        for one in items:
            if isinstance(one, RequestError):
                self.played.unreadable += 1
                self._tell(one)
                continue
            self.played.read += 1
            due = schedule.due(one.when_ns)
            if due is None:
                self.played.left_out["outside of --from and --to"] += 1
                continue
            if self._begin is None:
                self._begin = self._clock()
            self._serve(self._begin + due)
            self._take(one, self._begin + due)
            yield self.played.read
        self.played.gaps_cut += schedule.steps
        if self._begin is not None:
            self._begin += schedule.end

    def finish(self) -> None:
        """Until all that is on its way has come out."""
        while (deadline := self._way.deadline()) is not None:
            self._serve(deadline)

    def _serve(self, until: float) -> None:
        """Let out what is due, until then."""
        while True:
            for octets, one in self._way.due(self._clock()):
                self._send(octets, one)
            if self._clock() >= until:
                return
            deadline = self._way.deadline()
            self._end.wait(until if deadline is None else min(until, deadline))

    def _take(self, one: Pdu, due: float) -> None:
        try:
            changed = self._rewriting.apply(one, self._wall())
            octets = self._end.octets(changed)
        except RequestError as error:
            self._note(self.played.left_out, error, one)
            return
        now = self._clock()
        self.played.late_s = max(self.played.late_s, now - due)
        self._way.take(octets, now, changed)
        for given, about in self._way.due(now):
            self._send(given, about)

    def _send(self, octets: bytes, one: Pdu) -> None:
        try:
            self._end.send(octets, one)
        except RequestError as error:
            self._note(self.played.unsent, error, one)
        else:
            self.played.sent += 1

    def _note(self, tally: Counter[str], error: RequestError, one: Pdu) -> None:
        why = count(tally, error.message.removeprefix(f"{one.origin}: "))
        self.played.examples.setdefault(why, one.origin)
