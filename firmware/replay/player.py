"""Player of recordings: sends each message at its time, rewritten, over a lossy link."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from board.runtime.errors import RequestError
from drivers.wire.impairment import Impairment
from firmware.codec.reading import Pdu
from firmware.replay.ends import End
from firmware.replay.reasons import count
from firmware.replay.rewriting import Rewriting
from firmware.replay.timing import Schedule, Timing


@dataclass
class Played:
    """Counts of a replay; the lossy link has counts of its own.

    read        messages and frames.
    unreadable  items that are neither.
    left_out    omitted messages and frames by reason; they are also counted in read.
    sent        sent messages, including duplicates made by the lossy link.
    unsent      messages that could not be sent, by reason.
    late_s      longest delay of a message after it was due, in seconds.
    gaps_cut    number of places where a longer silence or a set clock of the recording was shortened.
    examples    place of the first message with each reason.
    """

    read: int = 0
    unreadable: int = 0
    left_out: Counter[str] = field(default_factory=Counter)
    sent: int = 0
    unsent: Counter[str] = field(default_factory=Counter)
    late_s: float = 0.0
    gaps_cut: int = 0
    examples: dict[str, str] = field(default_factory=dict)
    first_unreadable: RequestError | None = None

    @property
    def cause(self) -> RequestError | None:
        """First reason why an item was not read or sent; None if at least one message was read and all were sent."""
        if self.first_unreadable is not None:
            return self.first_unreadable
        if self.read > self.left_out.total() and not self.unsent:
            return None
        for why in (*self.unsent, *self.left_out):
            return RequestError(f"{self.examples[why]}: {why}" if why in self.examples else why)
        return RequestError("no message in what was read")


class Player:
    """Plays a recording in one or several rounds.

    tell   called with each error of an unreadable item.
    clock  monotonic time in seconds.
    wall   Unix time in nanoseconds.
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
        """Play one round, which begins where the previous one ended; yield the number of items read so far."""
        schedule = Schedule(self._timing)
        for one in items:
            if isinstance(one, RequestError):
                self.played.unreadable += 1
                self.played.first_unreadable = self.played.first_unreadable or one
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
        """Send all messages that the lossy link still delays."""
        while (deadline := self._way.deadline()) is not None:
            self._serve(deadline)

    def _serve(self, until: float) -> None:
        """Send the messages that are due until a monotonic time."""
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
