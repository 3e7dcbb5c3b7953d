"""How long a message was under way between two stations, by a stamp of each, and how well that is known."""

from typing import NamedTuple

from board.errors import RequestError
from board.time import TimeQuality


class Stamp(NamedTuple):
    """A moment by a station's system clock, with what the station said of that clock then.

    It is Unix time: between stamps before and after a leap second lies one second more, or one less.
    """

    system_ns: int
    quality: TimeQuality


class Delay(NamedTuple):
    """The truth is within ns +- uncertainty_ns. It may be below zero by as much as it is uncertain."""

    ns: int
    uncertainty_ns: int


def one_way(sent: Stamp, received: Stamp) -> Delay:
    """The time from one stamp to the other, each put right by the offset that its station knows of.

    The uncertainties are added. The root of the sum of squares would be for errors that are independent and as often
    this way as that: here most of either is one constant (how late interrupts are on that board, how far its crystal
    has gone since the last pulse) which the next thousand messages have alike, and two boards of one kind in one tunnel
    warm up alike. Each bound holds in 99.9 % of cases: their sum holds in 99.8 % whatever the two have in common, and
    in more where they have not.

    Raises RequestError where an end does not know how good its clock is.
    """
    ns = _true_ns(received, "receiver") - _true_ns(sent, "sender")
    return Delay(ns, (sent.quality.uncertainty_ns or 0) + (received.quality.uncertainty_ns or 0))


def _true_ns(stamp: Stamp, end: str) -> int:
    if stamp.quality.offset_ns is None or stamp.quality.uncertainty_ns is None:
        raise RequestError(
            f"one-way delay: the {end}'s clock is of unknown quality (time is {stamp.quality.state.name})",
            "wait until its status shows a state of time other than UNKNOWN",
        )
    return stamp.system_ns + stamp.quality.offset_ns
