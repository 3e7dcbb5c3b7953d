"""Why a pulse was not passed on. Every one that is not names one of these, is counted, and leaves a sample."""

from enum import StrEnum
from typing import NamedTuple

from pps.pulse import Pulse


class Why(StrEnum):
    """A reason as it stands in status and the journal; MEANING says it in words."""

    # the edge
    OFF_GRID = "off-grid"
    DUPLICATE = "duplicate"
    TRAILING = "trailing"
    # what the receiver said before it
    UNANNOUNCED = "unannounced"
    UNLOCKED = "unlocked"
    NO_SECOND = "no-second"
    ANNOUNCED_BADLY = "announced-badly"
    # what it said after it
    UNCONFIRMED = "unconfirmed"
    UNRESOLVED = "unresolved"
    CONFIRMED_BADLY = "confirmed-badly"
    # the one beside the other, and beside the seconds that have gone by
    DISAGREE = "disagree"
    UTC = "utc"
    OTHER_SECOND = "other-second"
    LATE = "late"
    ACQUIRING = "acquiring"


MEANING: dict[Why, str] = {
    Why.OFF_GRID: "no whole seconds since the last good pulse by CLOCK_MONOTONIC_RAW: noise, a trailing edge, or a late"
    " interrupt",
    Why.DUPLICATE: "its second has been passed on already, or another edge fits better to the seconds before",
    Why.TRAILING: "it bounces, or it may be the end of a pulse: edges up to 0.5 s before it begin seconds as well, and"
    " nothing tells yet which of them do",
    Why.UNANNOUNCED: "the receiver announced no pulse for this second; is TIM-TP configured, is the line overloaded?",
    Why.UNLOCKED: "the receiver says that the pulse does not follow the satellites, or has no fix of late",
    Why.NO_SECOND: "the announcement does not say which second: week, or leap seconds where it counts UTC, are unknown",
    Why.ANNOUNCED_BADLY: "the announcement gives an accuracy of time that is worse than the limit",
    Why.UNCONFIRMED: "no epoch of this second came after the pulse in time; is NAV-PVT configured, is the line"
    " overloaded?",
    Why.UNRESOLVED: "date, time or leap seconds of the epoch are not beyond doubt: after a cold start for 12.5 minutes",
    Why.CONFIRMED_BADLY: "the epoch gives an accuracy of time that is worse than the limit",
    Why.DISAGREE: "the announcement and the epoch speak of different seconds",
    Why.UTC: "UTC and GPS time of the epoch differ by other than the leap seconds that the receiver says",
    Why.OTHER_SECOND: "the receiver says another second than the one that has come by the seconds gone by since the"
    " last good pulse",
    Why.LATE: "what makes it good came after a later second had been passed on",
    Why.ACQUIRING: "good as far as is known; four that agree begin the count of seconds",
}


class Refused(NamedTuple):
    """A pulse that is not passed on. detail: what was seen, and beside what."""

    why: Why
    pulse: Pulse
    detail: str
