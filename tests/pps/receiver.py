"""A receiver, its pulses and a machine that sees both, second by second and word by word, for a test to tamper with."""

from collections.abc import Iterable
from typing import NamedTuple

from board.time.scales import EPOCH, GPS_LEAD, GPS_LEAPS, Fix, LeapEvent, TimeMark
from pps.pulse import Pulse
from pps.statements import WEEK_S
from pps.timemark import Event, Pairing, Second

START = 700_000_000  # ITS second that tests begin with: in March 2026
LEAPS = 18

RAW_NS = 5_000_000_000  # of CLOCK_MONOTONIC_RAW at START
MONOTONIC = 100.0

MARK_S, FIX_S = 0.08, 0.05  # after a pulse: the announcement of the next, and the epoch that it began


class Said(NamedTuple):
    """A word or an edge, and when it reaches the pairing, s after START."""

    at: float
    what: Pulse | TimeMark | Fix


def unix_s(its_s: int, leaps: int = LEAPS) -> int:
    return its_s + EPOCH + GPS_LEAPS - leaps


def pulse(second: float, late_ns: int = 0, ppm: float = 0.0, system_ns: int = 0) -> Pulse:
    """The edge of a second after START. ppm: of the raw clock. system_ns: how far the system's is ahead."""
    true_ns = round(second * 1e9) + late_ns
    return Pulse(
        round(second),
        unix_s(START) * 10**9 + true_ns + system_ns,
        RAW_NS + round(true_ns * (1 + ppm * 1e-6)),
        MONOTONIC + true_ns / 1e9,
    )


def mark(second: int, at: float | None = None, says: int | None = None, **changes: object) -> TimeMark:
    """TIM-TP for the pulse of a second. says: another second. at: when it comes, s after START."""
    its_s = START + (second if says is None else says)
    came = second - 1 + MARK_S if at is None else at
    good = TimeMark(MONOTONIC + came, unix_s(its_s), 22, 3_000, True, LEAPS, its_s)
    return good._replace(**changes)


def fix(second: float, at: float | None = None, says: float | None = None, **changes: object) -> Fix:
    """NAV-PVT of an epoch: of a second, or within it. says: another one."""
    told = second if says is None else says
    tow_ms = round((START + GPS_LEAD) % WEEK_S * 1000 + told * 1000) % (WEEK_S * 1000)
    came = second + FIX_S if at is None else at
    utc_ns = unix_s(START) * 10**9 + round(told * 1e9) - 412
    return Fix(MONOTONIC + came, utc_ns=utc_ns, utc_accuracy_ns=22, tow_ms=tow_ms)._replace(**changes)


def second(number: int, late_ns: int = 0, ppm: float = 0.0) -> list[Said]:
    """All of one: TIM-TP in the second before, the edge, NAV-PVT."""
    edge = pulse(number, late_ns, ppm)
    return [
        Said(number - 1 + MARK_S, mark(number)),
        Said(edge.monotonic - MONOTONIC, edge),
        Said(number + FIX_S, fix(number)),
    ]


def seconds(first: int, last: int, ppm: float = 0.0) -> list[Said]:
    """All of several, the last one included."""
    return [said for number in range(first, last + 1) for said in second(number, ppm=ppm)]


def play(pairing: Pairing, said: Iterable[Said], until: float | None = None) -> list[Event]:
    """Tell it all in the order of time, with the deadlines between; those of the last second too."""
    found: list[Event] = []
    end = 0.0
    for one in sorted(said, key=lambda one: one.at):
        found += _wait(pairing, one.at)
        end = one.at
        match one.what:
            case Pulse():
                found += pairing.pulse(one.what)
            case TimeMark():
                found += pairing.mark(one.what)
            case _:
                found += pairing.fix(one.what)
    return found + _wait(pairing, end + 2 if until is None else until)


def _wait(pairing: Pairing, until: float) -> list[Event]:
    found: list[Event] = []
    while (due := pairing.deadline()) is not None and due <= MONOTONIC + until:
        found += pairing.expire(due)
    return found


def labels(events: Iterable[Event]) -> list[int]:
    """The seconds that were passed on, after START."""
    return [event.its_s - START for event in events if isinstance(event, Second)]


def following(last: int = 3, ppm: float = 0.0) -> Pairing:
    """One that has acquired, up to a second."""
    pairing = Pairing()
    assert labels(play(pairing, seconds(0, last, ppm), until=last + 0.06)) == list(range(3, last + 1))
    return pairing


def event(second_: int, change: int = 1) -> LeapEvent:
    """A leap second at a second after START."""
    return LeapEvent(START + second_, change)
