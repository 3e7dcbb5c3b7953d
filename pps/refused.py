"""Reasons for refused pulses; each is counted and keeps a sample."""

from enum import StrEnum
from typing import NamedTuple

from pps.pulse import Pulse


class Why(StrEnum):
    """Reason for a refused pulse, as shown in status and the journal; MEANING explains it."""

    # judged by the edge alone
    OFF_GRID = "off-grid"
    DUPLICATE = "duplicate"
    TRAILING = "trailing"
    # judged by the announcement before it
    UNANNOUNCED = "unannounced"
    UNLOCKED = "unlocked"
    NO_SECOND = "no-second"
    ANNOUNCED_BADLY = "announced-badly"
    # judged by the epoch reported after it
    UNCONFIRMED = "unconfirmed"
    UNRESOLVED = "unresolved"
    CONFIRMED_BADLY = "confirmed-badly"
    # judged by comparing both with each other, and with the seconds counted so far
    DISAGREE = "disagree"
    UTC = "utc"
    OTHER_SECOND = "other-second"
    LATE = "late"
    ACQUIRING = "acquiring"


MEANING: dict[Why, str] = {
    Why.OFF_GRID: "no whole seconds since the last good pulse by CLOCK_MONOTONIC_RAW: noise, a trailing edge, or a late"
    " interrupt",
    Why.DUPLICATE: "its second is already used, or another edge fits better",
    Why.TRAILING: "a bounce or a trailing edge: edges up to 0.5 s before it may begin seconds as well",
    Why.UNANNOUNCED: "the receiver announced no pulse for this second; check that TIM-TP is configured, and the load of"
    " the line",
    Why.UNLOCKED: "the receiver reports that the pulse does not follow the satellites, or has no recent fix",
    Why.NO_SECOND: "the announcement does not say which second: week, or leap seconds where it counts UTC, are unknown",
    Why.ANNOUNCED_BADLY: "the announcement gives a time accuracy worse than the limit",
    Why.UNCONFIRMED: "no epoch of this second came after the pulse in time; check that NAV-PVT is configured,"
    " and the load of the line",
    Why.UNRESOLVED: "date, time or leap seconds of the epoch are not confirmed yet; a cold start needs up to"
    " 12.5 minutes",
    Why.CONFIRMED_BADLY: "the epoch gives a time accuracy worse than the limit",
    Why.DISAGREE: "the announcement and the epoch name different seconds",
    Why.UTC: "UTC and GPS time of the epoch do not differ by the receiver's leap seconds",
    Why.OTHER_SECOND: "the receiver names another second than the count since the last good pulse",
    Why.LATE: "its confirmation came after a later second was used",
    Why.ACQUIRING: "valid so far; the count begins after four that agree",
}


class Refused(NamedTuple):
    """Refused pulse. detail: the observed and the expected values."""

    why: Why
    pulse: Pulse
    detail: str
