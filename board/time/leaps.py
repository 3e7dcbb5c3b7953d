"""Leap-second table with its source; converts ITS time, UTC and Unix time.

ITS time counts through a leap second. Unix time has no number for an inserted leap second and repeats the second
before it, as the Linux kernel does; UTC writes it as 23:59:60. A removed second does not exist in ITS time.
"""

import time
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate

from board.runtime.errors import ConfigurationError, StationError
from board.time.leap_list import day, read_list
from board.time.scales import EPOCH, GPS_LEAPS, LEAPS, LEAPS_END, LeapEvent

RECEIVER = "receiver"
LIST = "/usr/share/zoneinfo/leap-seconds.list"  # Debian 13: in tzdata; its right/UTC moved to tzdata-legacy

# A receiver may report the old number for a minute after a leap second, and until its next message.
LATE_S = 120

_NS = 10**9


@dataclass(frozen=True)
class Leaps:
    """Table of leap seconds since 2004; before 2004, the count is zero.

    rows     leap seconds in ascending order.
    source   path of the list, "built in", or "receiver".
    expires  Unix time until which the table is complete; None: from satellites, which announce changes long before.
    doubt    why a better source is not used, or which source contradicts; logged once. Empty: nothing.
    base     table that a receiver's report modified; None: this table is unmodified.

    Conversions raise nothing. They are exact from 2004 to the last day of ITS time, in 2143.
    """

    rows: tuple[LeapEvent, ...]
    source: str
    expires: int | None
    doubt: str = ""
    base: "Leaps | None" = None

    def its_ns(self, unix_ns: int) -> int:
        """Return the ITS time of a Unix time. A second that Unix time repeats counts as the first of the two."""
        return unix_ns + (self._counts[bisect_right(self._midnights_ns, unix_ns)] - EPOCH) * _NS

    def unix_ns(self, its_ns: int) -> int:
        """Return the Unix time of an ITS time, as the kernel counts it."""
        return its_ns + (EPOCH - self.leap_seconds(its_ns)) * _NS

    def leap_seconds(self, its_ns: int) -> int:
        """Return the leap seconds inserted from 2004 to an ITS time; an inserted one counts from its own begin."""
        return self._counts[bisect_right(self._begins_ns, its_ns)]

    def civil(self, its_ns: int) -> str:
        """Return UTC of an ITS time, rounded down to the millisecond: 2016-12-31T23:59:60.010Z."""
        its_s, rest_ns = divmod(its_ns, _NS)
        at = bisect_right(self._begins_ns, its_ns) - 1  # index of the last row that has begun
        unix_s, inserted = self.unix_ns(its_s * _NS) // _NS, 0
        if at >= 0 and its_s < self.rows[at].its_s + self.rows[at].change:
            unix_s, inserted = self._midnights_ns[at] // _NS - 1, its_s - self.rows[at].its_s + 1
        when = time.gmtime(unix_s)
        return f"{time.strftime('%Y-%m-%dT%H:%M', when)}:{when.tm_sec + inserted:02}.{rest_ns // 10**6:03}Z"

    def next(self, its_ns: int) -> LeapEvent | None:
        """Return the first leap second after an ITS time; None if none is known."""
        at = bisect_right(self._begins_ns, its_ns)
        return self.rows[at] if at < len(self.rows) else None

    def is_expired(self, unix_s: float) -> bool:
        """Return whether the table may lack leap seconds at a Unix time."""
        return self.expires is not None and unix_s >= self.expires

    def told(self, leap_seconds: int, event: LeapEvent | None, its_s: int) -> "Leaps":
        """Return the table updated by a receiver's report from satellites; this table itself if nothing changes.

        Earlier rows remain those of the base. An announcement that the receiver no longer repeats is withdrawn.

        leap_seconds  GPS time minus UTC, before the event, s.
        event         leap second announced or just passed. None: the base's rows are kept, because not every receiver
                      announces leap seconds.
        its_s         current ITS time, s.
        """
        before = leap_seconds - GPS_LEAPS
        then_s = its_s if event is None else min(its_s, event.its_s - 1)  # when the count must be `before`
        base = known = self.base or self
        if not base._counts_as(before, then_s):
            is_learnt = self._counts_as(before, then_s)  # True after an announced leap second has passed
            # With an announced leap second, corrected rows lie before it, and no other recent row is kept.
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
        """Return the table with this count now. The dates of the missing rows are unknown; the last half-year is used.

        Since 1972, all leap seconds were at the end of a half-year.
        """
        import calendar  # imported late: it takes 10 ms, and is needed only if a source is wrong

        now = time.gmtime(its_s - count + EPOCH)
        turn = calendar.timegm((now.tm_year, 7 if now.tm_mon > 6 else 1, 1, 0, 0, 0))
        rows = tuple(row for row, ns in zip(self.rows, self._midnights_ns, strict=True) if ns < turn * _NS)
        earlier = sum(row.change for row in rows)
        ours = self.leap_seconds(its_s * _NS)
        doubt = (
            f"leap seconds: GPS time is {count + GPS_LEAPS} s ahead of UTC according to the receiver,"
            f" {ours + GPS_LEAPS} s according to {self.name}"
        )
        return replace(self, rows=rows + events([(turn, count - earlier)], earlier), doubt=doubt)

    def _announced(self, event: LeapEvent, its_s: int) -> "Leaps":
        """Return the table with this event as the only future row; a contrary row may begin a second earlier."""
        begun_s = min(its_s, event.its_s - LATE_S)
        rows = (*(row for row in self.rows if row.its_s <= begun_s), event)
        when = day(event.its_s - self.leap_seconds((event.its_s - 1) * _NS) + EPOCH - 1)
        if self.is_expired(self.unix_ns(event.its_s * _NS) / _NS):
            return replace(self, rows=rows)
        told = "an inserted leap second" if event.change > 0 else "a removed leap second"
        doubt = f"leap seconds: the receiver announces {told} at the end of {when}; {self.name} has none"
        return replace(self, rows=rows, doubt=doubt)

    @property
    def name(self) -> str:
        """Name of the source with the day of its expiry, for sentences."""
        name = "the table built in" if self.source == BUILT_IN.source else self.source
        return name if self.expires is None else f"{name}, which is complete until {day(self.expires)}"

    @cached_property
    def _counts(self) -> tuple[int, ...]:
        """Counts of leap seconds: before the first row, then after each row."""
        return (0, *accumulate(row.change for row in self.rows))

    @cached_property
    def _begins_ns(self) -> tuple[int, ...]:
        return tuple(row.its_s * _NS for row in self.rows)

    @cached_property
    def _midnights_ns(self) -> tuple[int, ...]:
        """Unix times in ns of the midnight after each row."""
        return tuple(
            (EPOCH + row.its_s - before - min(row.change, 0)) * _NS
            for row, before in zip(self.rows, self._counts, strict=False)
        )


def events(changes: Iterable[tuple[int, int]], before: int = 0) -> tuple[LeapEvent, ...]:
    """Return the rows of changes.

    changes  Unix time of the midnight after each leap second, and 1 or -1.
    before   number of leap seconds before them.
    """
    rows = []
    for midnight, change in changes:
        if change:
            rows.append(LeapEvent(midnight - EPOCH + before + min(change, 0), change))
        before += change
    return tuple(rows)


BUILT_IN = Leaps(events((midnight, 1) for midnight in LEAPS), "built in", LEAPS_END)


def read(path: str) -> Leaps:
    """Return the table of a leap-seconds.list, even if expired.

    Raises ConfigurationError if it is unreadable or damaged, or its known leap seconds differ from the built-in ones.
    """
    listed = read_list(path)
    known_until = min(listed.expires, LEAPS_END)
    was = [(midnight, 1) for midnight in LEAPS if midnight <= known_until]
    says = [(midnight, change) for midnight, change in listed.changes if midnight <= known_until]
    if was != says:
        wrong = min(midnight for midnight, _ in set(was) ^ set(says))
        what = "it lacks the leap second before" if wrong in LEAPS else "it has an additional leap second before"
        raise ConfigurationError(f"{path}: {what} {day(wrong)}", "reinstall the package tzdata")
    return Leaps(events(listed.changes), path, listed.expires)


def known(path: str, unix_s: float) -> Leaps:
    """Return the table of a list if it is valid at a Unix time or has more rows than the built-in table; else that.

    path  path of the list; empty: the built-in table is wanted.
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
    if BUILT_IN.is_expired(unix_s):  # one message for both: today's leap seconds are unknown
        is_one_day = day(listed.expires or 0) == day(LEAPS_END)
        also = "like the built-in table" if is_one_day else f"the built-in table on {day(LEAPS_END)}"
        return replace(BUILT_IN, doubt=f"{path}: {expired}, {also}; update tzdata")
    return _built_in(f"{path}: {expired}", unix_s)


def _built_in(why: str, unix_s: float) -> Leaps:
    """Return the built-in table; its doubt tells why no list is used, and whether the table expired."""
    used = "the built-in table of leap seconds"
    if BUILT_IN.is_expired(unix_s):
        return replace(BUILT_IN, doubt=f"{why}; {used} expired on {day(LEAPS_END)}".removeprefix("; "))
    return replace(BUILT_IN, doubt=f"{why}; {used} is used") if why else BUILT_IN
