"""Leap seconds by whose word they are, and what Unix time and UTC are by them: the edges of ITS time.

ITS time counts on through a leap second. Unix time has no number for one that is inserted and repeats the second
before it, as the Linux kernel does; UTC writes it as 23:59:60. One that is left out has no second in ITS time.
"""

import time
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate

from board.errors import ConfigurationError, StationError
from board.leap_list import day, read_list
from board.time import EPOCH, GPS_LEAPS, LEAPS, LEAPS_END, LeapEvent

RECEIVER = "receiver"
LIST = "/usr/share/zoneinfo/leap-seconds.list"  # of tzdata of Debian 13; right/UTC has gone to tzdata-legacy there

# A receiver may count the old number behind a leap second for a minute, and then its next message has to come.
LATE_S = 120

_NS = 10**9


@dataclass(frozen=True)
class Leaps:
    """A table of leap seconds since 2004. Before 2004 it counts none.

    rows     ascending, as LeapEvent has them.
    source   path of the list, "built in", or "receiver".
    expires  Unix time until which it is known to be complete; None: by satellites, which tell of changes long before.
    doubt    why it is this one and no better one, or what contradicts it: for the log, once; empty: nothing.
    base     that a receiver was heard about; None: this is one.

    Conversions raise nothing, and are exact from 2004 to the last day that ITS time has, in 2143.
    """

    rows: tuple[LeapEvent, ...]
    source: str
    expires: int | None
    doubt: str = ""
    base: "Leaps | None" = None

    def its_ns(self, unix_ns: int) -> int:
        """ITS time of a Unix time. A second that Unix time repeats is taken for the first of the two."""
        return unix_ns + (self._counts[bisect_right(self._midnights_ns, unix_ns)] - EPOCH) * _NS

    def unix_ns(self, its_ns: int) -> int:
        """Unix time of an ITS time, as the kernel counts it."""
        return its_ns + (EPOCH - self.leap_seconds(its_ns)) * _NS

    def leap_seconds(self, its_ns: int) -> int:
        """Inserted since 2004 at a moment of ITS time; one that is inserted counts from its own begin on."""
        return self._counts[bisect_right(self._begins_ns, its_ns)]

    def civil(self, its_ns: int) -> str:
        """UTC of an ITS time, to the millisecond below: 2016-12-31T23:59:60.010Z."""
        its_s, rest_ns = divmod(its_ns, _NS)
        at = bisect_right(self._begins_ns, its_ns) - 1  # of the last row that has begun
        unix_s, inserted = self.unix_ns(its_s * _NS) // _NS, 0
        if at >= 0 and its_s < self.rows[at].its_s + self.rows[at].change:
            unix_s, inserted = self._midnights_ns[at] // _NS - 1, its_s - self.rows[at].its_s + 1
        when = time.gmtime(unix_s)
        return f"{time.strftime('%Y-%m-%dT%H:%M', when)}:{when.tm_sec + inserted:02}.{rest_ns // 10**6:03}Z"

    def next(self, its_ns: int) -> LeapEvent | None:
        """The first row that begins behind a moment of ITS time."""
        at = bisect_right(self._begins_ns, its_ns)
        return self.rows[at] if at < len(self.rows) else None

    def is_expired(self, unix_s: float) -> bool:
        """Whether there may be leap seconds that it does not know."""
        return self.expires is not None and unix_s >= self.expires

    def told(self, leap_seconds: int, event: LeapEvent | None, its_s: int) -> "Leaps":
        """The table by the word of a receiver, which has it from satellites: itself where that is nothing new.

        What it does not tell stays as the base has it; what it does not announce any more is withdrawn.

        leap_seconds  GPS time less UTC, before the event, s.
        event         announced, or just passed; without one, rows of the base are kept: not every receiver tells.
        its_s         ITS time of now.
        """
        before = leap_seconds - GPS_LEAPS
        then_s = its_s if event is None else min(its_s, event.its_s - 1)  # when that many are counted
        base = known = self.base or self
        if not base._counts_as(before, then_s):
            is_learnt = self._counts_as(before, then_s)  # as an event that was announced and has passed
            # Beside an event no other is kept: what is corrected comes before it.
            when_s = then_s if event is None else min(then_s, event.its_s - LATE_S)
            known = self._until(then_s) if is_learnt else base._corrected(before, when_s)
        if event is not None and event not in known.rows:
            known = known._announced(event, then_s)
        told = replace(known, source=RECEIVER, expires=None, base=base)
        return self if told == self else told

    def _counts_as(self, count: int, its_s: int) -> bool:
        return count in (self.leap_seconds(its_s * _NS), self.leap_seconds((its_s - LATE_S) * _NS))

    def _until(self, its_s: int) -> "Leaps":
        return replace(self, rows=tuple(row for row in self.rows if row.its_s <= its_s))

    def _corrected(self, count: int, its_s: int) -> "Leaps":
        """With so many now. When the others came nobody tells: since 1972 it was the turn of a half-year."""
        import calendar  # here, for it takes 10 ms, and is needed where somebody is wrong

        now = time.gmtime(its_s - count + EPOCH)
        turn = calendar.timegm((now.tm_year, 7 if now.tm_mon > 6 else 1, 1, 0, 0, 0))
        rows = tuple(row for row, ns in zip(self.rows, self._midnights_ns, strict=True) if ns < turn * _NS)
        earlier = sum(row.change for row in rows)
        ours = self.leap_seconds(its_s * _NS)
        doubt = (
            f"leap seconds: GPS time is {count + GPS_LEAPS} s ahead of UTC by the receiver's word,"
            f" {ours + GPS_LEAPS} s by that of {self.name}"
        )
        return replace(self, rows=rows + events([(turn, count - earlier)], earlier), doubt=doubt)

    def _announced(self, event: LeapEvent, its_s: int) -> "Leaps":
        """With an event to come, in place of all others to come: a contrary one, too, may begin a second earlier."""
        begun_s = min(its_s, event.its_s - LATE_S)
        rows = (*(row for row in self.rows if row.its_s <= begun_s), event)
        when = day(event.its_s - self.leap_seconds((event.its_s - 1) * _NS) + EPOCH - 1)
        if self.is_expired(self.unix_ns(event.its_s * _NS) / _NS):
            return replace(self, rows=rows)
        told = "one that is inserted" if event.change > 0 else "one that is left out"
        doubt = f"leap seconds: the receiver tells of {told} at the end of {when}, and {self.name} of none"
        return replace(self, rows=rows, doubt=doubt)

    @property
    def name(self) -> str:
        """As a sentence has it, with the day of its expiry."""
        name = "the table built in" if self.source == BUILT_IN.source else self.source
        return name if self.expires is None else f"{name}, which is complete until {day(self.expires)}"

    @cached_property
    def _counts(self) -> tuple[int, ...]:
        """Leap seconds before the first row, and behind each."""
        return (0, *accumulate(row.change for row in self.rows))

    @cached_property
    def _begins_ns(self) -> tuple[int, ...]:
        return tuple(row.its_s * _NS for row in self.rows)

    @cached_property
    def _midnights_ns(self) -> tuple[int, ...]:
        """Unix time behind each row."""
        return tuple(
            (EPOCH + row.its_s - before - min(row.change, 0)) * _NS
            for row, before in zip(self.rows, self._counts, strict=False)
        )


def events(changes: Iterable[tuple[int, int]], before: int = 0) -> tuple[LeapEvent, ...]:
    """Rows of changes, each by Unix time of the midnight behind it and 1 or -1; before: leap seconds before them."""
    rows = []
    for midnight, change in changes:
        if change:
            rows.append(LeapEvent(midnight - EPOCH + before + min(change, 0), change))
        before += change
    return tuple(rows)


BUILT_IN = Leaps(events((midnight, 1) for midnight in LEAPS), "built in", LEAPS_END)


def read(path: str) -> Leaps:
    """The table of a leap-seconds.list, expired or not.

    Raises ConfigurationError where it cannot be read, is damaged, or denies a leap second that there was.
    """
    listed = read_list(path)
    known_until = min(listed.expires, LEAPS_END)
    was = [(midnight, 1) for midnight in LEAPS if midnight <= known_until]
    says = [(midnight, change) for midnight, change in listed.changes if midnight <= known_until]
    if was != says:
        wrong = min(midnight for midnight, _ in set(was) ^ set(says))
        what = "it denies the leap second before" if wrong in LEAPS else "there was no leap second before"
        raise ConfigurationError(f"{path}: {what} {day(wrong)}", "take that of a package tzdata that is intact")
    return Leaps(events(listed.changes), path, listed.expires)


def known(path: str, unix_s: float) -> Leaps:
    """The table of a list, while it holds at a Unix time or knows more than is built in; else what is built in.

    path  may be empty: no list is wanted.
    """
    if not path:
        return _built_in("", unix_s)
    try:
        listed = read(path)
    except StationError as error:
        return _built_in(error.message, unix_s)
    if not listed.is_expired(unix_s):
        return listed
    expired = f"expired on {day(listed.expires or 0)}"
    if len(listed.rows) > len(BUILT_IN.rows):
        return replace(listed, doubt=f"{path}: {expired} but used: it has more leap seconds than the built-in table")
    if BUILT_IN.is_expired(unix_s):  # one fact: nobody here knows the leap seconds of today
        is_one_day = day(listed.expires or 0) == day(LEAPS_END)
        also = "like the built-in table" if is_one_day else f"the built-in table on {day(LEAPS_END)}"
        return replace(BUILT_IN, doubt=f"{path}: {expired}, {also}; update tzdata")
    return _built_in(f"{path}: {expired}", unix_s)


def _built_in(why: str, unix_s: float) -> Leaps:
    """With why it is no list, and whether there may be leap seconds by now that it does not know."""
    used = "the built-in table of leap seconds"
    if BUILT_IN.is_expired(unix_s):
        return replace(BUILT_IN, doubt=f"{why}; {used} expired on {day(LEAPS_END)}".removeprefix("; "))
    return replace(BUILT_IN, doubt=f"{why}; {used} is used") if why else BUILT_IN
