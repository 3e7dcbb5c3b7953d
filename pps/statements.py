"""Receiver's recent messages, matched with pulses.

TIM-TP announces the next pulse; NAV-PVT describes a past epoch. The time of arrival bounds their meaning on one side
only. A receiver cannot announce a pulse before the one ahead of it, or report a future epoch. But a message may arrive
arbitrarily late, on a slow line or with a stalled loop. While seconds are counted, a message must name the right
second and must have been possible at its arrival. Before, it must also arrive in time.
"""

from collections import deque
from typing import NamedTuple

from board.time.scales import EPOCH, GPS_LEAD, GPS_LEAPS, Fix, TimeMark
from pps.pulse import Pulse
from pps.refused import Why

# u-blox F9P, UBX-22008968: the time pulse is within 60 ns in 99 % of cases; a receiver that reports 1 us has lost it.
LIMIT_NS = 1_000

WEEK_S = 604_800

KEPT = 64  # most statements kept of each kind; covers as many seconds of a stalled loop

# Tolerance for messages that seem earlier than possible by the loop's clock. That clock is slewed by chronyd, by up to
# 8.3 %. Also, another thread stamps the pulses.
SLACK_S = 0.1
# Longest time from an epoch to NAV-PVT: 30 ms at 10 Hz over USB, 300 ms at 38,400 baud behind all other messages. A
# message in the last third of a second may be late by a whole second.
IN_TIME_S = 0.7

# iTOW is rounded, and the clock of some receivers runs free, so an epoch may be reported just before its second.
_EARLY_MS = 5
_UTC_NS = 100_000_000  # largest difference of UTC and GPS time of an epoch; errors to be detected are a whole second
_EVENT_S = 2  # seconds around a leap second in which UTC is not checked, because firmware versions differ there


class Epoch(NamedTuple):
    """Fix as a statement of time. tow_s: second of the week; after_s: position within that second."""

    fix: Fix
    monotonic: float
    tow_s: int
    after_s: float
    is_good: bool


class Statements:
    """Recent messages in order of arrival. limit_ns: accuracy of time that the receiver must report at least."""

    def __init__(self, limit_ns: int = LIMIT_NS) -> None:
        self._limit_ns = limit_ns
        self._marks: deque[TimeMark] = deque(maxlen=KEPT)
        self._epochs: deque[Epoch] = deque(maxlen=KEPT)

    def mark(self, mark: TimeMark) -> None:
        """Add an announcement."""
        self._marks.append(mark)

    def fix(self, fix: Fix) -> bool:
        """Add an epoch; return whether it is new information, as the first good epoch of a second is."""
        if fix.tow_ms is None:
            return False
        tow_s, after_ms = divmod(fix.tow_ms + _EARLY_MS, 1000)
        is_good = fix.utc_ns is not None and fix.utc_accuracy_ns is not None and fix.utc_accuracy_ns <= self._limit_ns
        epochs = self._epochs
        if epochs and epochs[-1].tow_s == tow_s and fix.monotonic - epochs[-1].monotonic < IN_TIME_S:
            if epochs[-1].is_good or not is_good:
                return False
            epochs.pop()
        epochs.append(Epoch(fix, fix.monotonic, tow_s, (after_ms - _EARLY_MS) / 1000, is_good))
        return True

    def announced(self, pulse: Pulse, its_s: int) -> TimeMark | None:
        """Return the last good announcement of the second that can apply to the pulse, even if it came late."""
        possible = pulse.monotonic - 1 - SLACK_S
        for mark in reversed(self._marks):
            if mark.monotonic < possible:
                break
            if mark.its_s == its_s and self._objection(mark) is None:
                return mark
        return None

    def confirmed(self, pulse: Pulse, its_s: int) -> Epoch | None:
        """Return the last good epoch of the second that can be a report after the pulse, even if it came late."""
        tow_s, possible = (its_s + GPS_LEAD) % WEEK_S, pulse.monotonic - SLACK_S
        for epoch in reversed(self._epochs):
            if epoch.monotonic < possible:
                break
            if epoch.tow_s == tow_s and epoch.is_good and epoch.monotonic >= possible + epoch.after_s:
                return epoch
        return None

    def claim(self, pulse: Pulse) -> tuple[int, TimeMark, Fix] | None:
        """Return the second that both messages in time give a pulse; None if one is missing, bad or contradictory."""
        mark, epoch = self._mark_before(pulse), self._epoch_after(pulse)
        if mark is None or epoch is None or self.objection(pulse, mark, epoch) is not None:
            return None
        assert mark.its_s is not None
        return mark.its_s, mark, epoch.fix

    def why(self, pulse: Pulse, its_s: int | None) -> tuple[Why, str]:
        """Return why the messages do not confirm a pulse. its_s: its expected second; None if unknown."""
        mark, epoch = self._mark_before(pulse), self._epoch_after(pulse)
        if its_s is not None:
            tow_s, possible = (its_s + GPS_LEAD) % WEEK_S, pulse.monotonic - SLACK_S
            marks = (one for one in reversed(self._marks) if one.its_s == its_s and one.monotonic >= possible - 1)
            epochs = (one for one in reversed(self._epochs) if one.tow_s == tow_s and one.monotonic >= possible)
            mark, epoch = next(marks, mark), next(epochs, epoch)
            if mark is not None and self._objection(mark) is None and mark.its_s != its_s:
                return Why.OTHER_SECOND, f"announced as second {mark.its_s}, but counted as second {its_s}"
        return self.objection(pulse, mark, epoch) or (Why.LATE, f"second {its_s}")

    def objection(self, pulse: Pulse, mark: TimeMark | None, epoch: Epoch | None) -> tuple[Why, str] | None:
        """Return why an announcement and an epoch do not confirm a pulse; None if they do."""
        if mark is None:
            return Why.UNANNOUNCED, f"no announcement in the second before {pulse.monotonic:.3f} s"
        objection = self._objection(mark)
        if objection is not None:
            return objection
        assert mark.its_s is not None
        if epoch is None:
            return Why.UNCONFIRMED, f"announced as second {mark.its_s}, but no epoch of this second arrived"
        fix = epoch.fix
        if fix.utc_ns is None or fix.utc_accuracy_ns is None:
            return Why.UNRESOLVED, f"epoch of second {epoch.tow_s} of the week"
        if not epoch.is_good:
            return Why.CONFIRMED_BADLY, f"{fix.utc_accuracy_ns} ns, limit {self._limit_ns} ns"
        tow_s = (mark.its_s + GPS_LEAD) % WEEK_S
        if epoch.tow_s != tow_s:
            return Why.DISAGREE, f"announced as second {tow_s} of the week, but the epoch has second {epoch.tow_s}"
        if not is_of_utc(epoch, mark.its_s, mark):
            return Why.UTC, f"second {mark.its_s} with {mark.leap_seconds} leap seconds, Unix time {fix.utc_ns} ns"
        return None

    def _objection(self, mark: TimeMark) -> tuple[Why, str] | None:
        if mark.its_s is None:
            return Why.NO_SECOND, f"announced at {mark.monotonic:.3f} s"
        if not mark.is_locked or mark.leap_seconds is None:
            return Why.UNLOCKED, f"announced as second {mark.its_s}"
        if mark.accuracy_ns > self._limit_ns:
            return Why.ANNOUNCED_BADLY, f"{mark.accuracy_ns} ns, limit {self._limit_ns} ns"
        return None

    def _mark_before(self, pulse: Pulse) -> TimeMark | None:
        """Return the last announcement between the previous pulse and this one; a good one if there is any."""
        latest, earliest = pulse.monotonic, pulse.monotonic - 1 - SLACK_S
        found = [mark for mark in reversed(self._marks) if earliest <= mark.monotonic <= latest]
        return next((mark for mark in found if self._objection(mark) is None), found[0] if found else None)

    def _epoch_after(self, pulse: Pulse) -> Epoch | None:
        """Return the first epoch from the pulse on that was reported in time; a good one if there is any."""
        first = pulse.monotonic
        found = [epoch for epoch in self._epochs if -SLACK_S <= epoch.monotonic - first - epoch.after_s <= IN_TIME_S]
        return next((epoch for epoch in found if epoch.is_good), found[0] if found else None)


def is_of_utc(epoch: Epoch, its_s: int, mark: TimeMark) -> bool:
    """Return whether UTC of an epoch agrees with its ITS second, given the leap seconds of an announcement."""
    assert mark.leap_seconds is not None
    assert epoch.fix.utc_ns is not None
    event, leaps = mark.leap_event, mark.leap_seconds
    if event is not None:
        if abs(its_s - event.its_s) <= _EVENT_S:
            return True
        leaps += event.change * (its_s > event.its_s)
    unix_s = its_s + EPOCH + GPS_LEAPS - leaps
    return abs(epoch.fix.utc_ns - unix_s * 1_000_000_000 - epoch.after_s * 1e9) <= _UTC_NS
