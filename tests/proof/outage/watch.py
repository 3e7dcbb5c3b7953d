"""When a path to the broker worked, by what came through; and how soon after a trouble it did again."""

import math
from collections import deque

from firmware.client.show.table import Table
from tests.proof.chaos.run import Goal
from tests.proof.outage.pattern import Kind, Trouble

# A whole try may just have begun in vain, 10 s, and the pause after it is the longer the more have failed before.
BACK_S = 20.0
ABSENCE_S = 45.0  # the same with the longest pause
TOLD_S = 1.0
MISSED = 0.2  # of troubles that the next follows before a message is through: after a handover that takes 3 s

SPANS = 64  # of a path that worked, remembered: a lifetime has few


class Watch:
    """Of one path.

    back_s    from the end of a trouble until a message was through, by its kind.
    not_back  how often none did before the next trouble.
    is_troubled  there is one just now.
    """

    def __init__(self) -> None:
        self.back_s: dict[Kind, list[float]] = {kind: [] for kind in Kind}
        self.not_back = 0
        self._since: float | None = None
        self._spans: deque[tuple[float, float]] = deque(maxlen=SPANS)
        self.is_troubled = False
        self._ended = -math.inf
        self._last: tuple[Kind, float] | None = None  # the trouble that it is not back from, and when that ended

    def begin(self, now: float) -> None:
        """Of a trouble."""
        self.not_back += self._last is not None
        self._last = None
        self.is_troubled = True
        if self._since is not None:
            self._spans.append((self._since, now))
            self._since = None

    def end(self, trouble: Trouble, now: float) -> None:
        self.is_troubled = False
        self._last = trouble.kind, now
        self._ended = now

    def through(self, now: float, accepted: float) -> None:
        """A message is through, with its acknowledgement if it has one: the path works until the next trouble.

        accepted  when it was asked for: one from before the end of a trouble says nothing of those behind it.
        """
        if self.is_troubled or self._since is not None or accepted < self._ended:
            return
        self._since = now
        if self._last is not None:
            kind, ended = self._last
            self.back_s[kind].append(now - ended)
            self._last = None

    def was_usable(self, begin: float, end: float, need_s: float) -> bool:
        """Whether it worked for need_s in one piece between two moments, the later of them not in the future."""
        spans = [*self._spans, *([(self._since, end)] if self._since is not None else [])]
        return any(min(end, last) - max(begin, first) >= need_s for first, last in spans)


def goals(name: str, watch: Watch, told: frozenset[Kind] = frozenset()) -> list[Goal]:
    """Whether it was back in time. told: kinds of trouble that its modem tells the beginning and the end of."""
    limits = {kind: TOLD_S if kind in told else ABSENCE_S if kind is Kind.ABSENCE else BACK_S for kind in Kind}
    late = [
        f"{one:.1f} s after {kind.value}" for kind, times in watch.back_s.items() for one in times if one > limits[kind]
    ]
    count = watch.not_back + sum(map(len, watch.back_s.values()))
    seen = f"{len(late)} of {count} late {', '.join(late[:3])}".rstrip()
    return [
        Goal(
            f"{name}: it is back within {BACK_S:g} s, {ABSENCE_S:g} s after minutes, {TOLD_S:g} s if told",
            seen,
            not late,
        ),
        Goal(
            f"{name}: it is back before the next trouble, in {1 - MISSED:.0%} of all",
            f"{count - watch.not_back} of {count}",
            watch.not_back <= max(1, MISSED * count),
        ),
    ]


def table(watches: dict[str, Watch]) -> Table:
    """How soon each was back, by the kind of trouble."""
    rows = []
    for name, watch in watches.items():
        for kind, found in watch.back_s.items():
            times = sorted(found)
            if times:
                shown = (times[len(times) // 2], times[int(0.95 * len(times))], times[-1])
                rows.append((name, kind.value, str(len(times)), *(f"{one:.2f}" for one in shown)))
    heads = ("interface", "after", ">times", ">median s", ">95 % s", ">longest s")
    missed = ", ".join(f"{name} {watch.not_back}" for name, watch in watches.items())
    title = "from the end of a trouble until a message is through"
    return Table(title, heads, rows, (f"not before the next trouble: {missed}",))
