"""One-way delay between two stations, with its uncertainty."""

from typing import NamedTuple

from board.runtime.errors import RequestError
from board.time.scales import TimeQuality


class Stamp(NamedTuple):
    """Time stamp by a station's system clock, with the quality of that clock at the time.

    It is Unix time: the difference of stamps before and after a leap second is one second off.
    """

    system_ns: int
    quality: TimeQuality


class Delay(NamedTuple):
    """Delay in ns; the true delay is within +- uncertainty_ns. It may be negative by as much."""

    ns: int
    uncertainty_ns: int


def one_way(sent: Stamp, received: Stamp) -> Delay:
    """Return the time between two stamps, each corrected by the known offset of its station's clock.

    The uncertainties are added. The root of the sum of squares would require errors that are independent and centred on
    zero. Here, most of each error is a constant: the lateness of interrupts on that board, and its crystal's drift
    since the last pulse. The next thousand messages share it. Two boards of one kind in one tunnel also warm up alike.
    Each bound holds in 99.9 % of cases. Their sum holds in 99.8 % even if the errors are related, and more often if
    not.

    Raises RequestError if the quality of either clock is unknown.
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
