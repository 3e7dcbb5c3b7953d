"""The mobile network of a vehicle over a day, as data: python -m tests.proof.outage.pattern --seed 1 prints how many of each.

A day is a chain of phases (city, motorway, country road, parked), each with its rate of troubles, drawn from a seed.
The durations are those that drives through tunnels, under bridges and over cell borders are known for: seconds, with a
long tail; a garage or a dead valley takes minutes.
"""

import argparse
import random
import sys
from collections.abc import Iterator, Sequence
from enum import Enum
from typing import NamedTuple

from firmware.client.show.table import Screen, Table

DAY_S = 86400.0
SHORT_S = 20.0  # an outage up to this is one that a vehicle drives through
APART_S = 2.0  # at least, between two troubles

# Of a cut: what is left of the quiet between two troubles, and of a slow stretch.
PAUSE_S = 5.2
SLOW_S = 6.0

# Of a squeezed one: what is left of minutes without coverage. Longer than the longest pause between two tries, and than a
# broker keeps a session that nobody resumes (one and a half keep-alives and SESSION_EXPIRY_S).
ABSENCE_S = 75.0


class Kind(Enum):
    """What happens to the network.

    TUNNEL    nothing passes, either way; nobody is told.
    HANDOVER  the same, and afterwards this end has another address: old connections are dead, and nobody is told.
    LOSS      the device itself is down: what is sent fails at once. The address stays.
    ABSENCE   minutes without coverage; afterwards this end has another address.
    SLOW      it passes little, and late.
    """

    TUNNEL = "tunnel"
    HANDOVER = "handover"
    LOSS = "loss"
    ABSENCE = "absence"
    SLOW = "slow"


NEW_ADDRESS = frozenset({Kind.HANDOVER, Kind.ABSENCE})


class Trouble(NamedTuple):
    """One of them, so many seconds after the beginning.

    rate_bit_s  that a SLOW one lets through each way; 0 for the others.
    """

    at_s: float
    kind: Kind
    lasts_s: float
    rate_bit_s: int = 0

    @property
    def end_s(self) -> float:
        return self.at_s + self.lasts_s

    @property
    def is_outage(self) -> bool:
        """Nothing passes, for up to SHORT_S."""
        return self.kind is not Kind.SLOW and self.lasts_s <= SHORT_S


class Length(NamedTuple):
    """Of a kind of trouble: log-normal about a median, within limits; in seconds."""

    median_s: float
    spread: float
    least_s: float
    most_s: float

    def draw(self, chance: random.Random) -> float:
        return min(self.most_s, max(self.least_s, self.median_s * chance.lognormvariate(0.0, self.spread)))


LENGTHS = {
    Kind.TUNNEL: Length(5.0, 0.7, 0.5, SHORT_S),
    Kind.HANDOVER: Length(0.7, 0.8, 0.1, SHORT_S),
    Kind.LOSS: Length(2.0, 0.9, 0.2, SHORT_S),
    Kind.ABSENCE: Length(180.0, 0.6, 60.0, 900.0),
    Kind.SLOW: Length(20.0, 0.6, 5.0, 120.0),
}

# Ten CAMs a second with their acknowledgements take 30 kbit/s each way: the first is too little for them.
RATES_BIT_S = (16_000, 48_000, 128_000)


class Phase(NamedTuple):
    """minutes: least and most that it lasts. per_hour: how many of each kind."""

    name: str
    weight: float
    minutes: tuple[float, float]
    per_hour: dict[Kind, float]


def _rates(tunnel: float, handover: float, loss: float, absence: float, slow: float) -> dict[Kind, float]:
    return dict(zip(Kind, (tunnel, handover, loss, absence, slow), strict=True))


PHASES = (
    Phase("city", 4, (10, 40), _rates(6, 40, 20, 0.5, 3)),
    Phase("motorway", 3, (25, 90), _rates(10, 50, 12, 0.2, 2)),
    Phase("country road", 2, (15, 60), _rates(3, 15, 30, 1.0, 8)),
    Phase("parked", 1, (20, 120), _rates(0, 1, 1, 0.6, 1)),
)


def day(seed: int, seconds: float = DAY_S) -> tuple[Trouble, ...]:
    """The troubles of 24 hours in their order, none within APART_S of another. The same for the same seed."""
    chance = random.Random(f"outage {seed}")
    found: list[Trouble] = []
    for begin, end, phase in _phases(chance, seconds):
        now = max(begin, found[-1].end_s if found else 0.0)
        while True:
            now += APART_S + chance.expovariate(sum(phase.per_hour.values()) / 3600.0)
            (kind,) = chance.choices(tuple(phase.per_hour), tuple(phase.per_hour.values()))
            trouble = _trouble(chance, kind, now)
            if trouble.end_s > min(end, seconds - APART_S):
                break
            found.append(trouble)
            now = trouble.end_s
    return tuple(found)


def cut(troubles: Sequence[Trouble], seconds: float) -> tuple[Trouble, ...]:
    """So many seconds of it without the quiet and without what lasts minutes; they begin with one of each kind.

    1800 s hold at least 200 outages.
    """
    short = [one for one in troubles if one.is_outage or one.kind is Kind.SLOW]
    wanted = len({one.kind for one in short if one.is_outage})
    first = next(at for at in range(len(short)) if len({one.kind for one in short[at : at + wanted]}) >= wanted)
    found: list[Trouble] = []
    now = PAUSE_S
    for one in short[first:]:
        lasts_s = min(one.lasts_s, SLOW_S) if one.kind is Kind.SLOW else one.lasts_s
        if now + lasts_s + PAUSE_S > seconds:
            break
        found.append(one._replace(at_s=now, lasts_s=lasts_s))
        now += lasts_s + PAUSE_S
    return tuple(found)


def squeezed(troubles: Sequence[Trouble]) -> tuple[Trouble, ...]:
    """All of them with no more than a pause between two, and the longest ones cut short."""
    found: list[Trouble] = []
    now = 0.0
    for one, before in zip(troubles, (None, *troubles), strict=False):
        now += min(PAUSE_S, one.at_s - (before.end_s if before else 0.0))
        found.append(one._replace(at_s=now, lasts_s=min(one.lasts_s, ABSENCE_S)))
        now = found[-1].end_s
    return tuple(found)


def table(title: str, troubles: Sequence[Trouble]) -> Table:
    """How many of each kind, how long."""
    rows = []
    for kind in Kind:
        lengths = sorted(one.lasts_s for one in troubles if one.kind is kind)
        if lengths:
            median, most = lengths[len(lengths) // 2], lengths[-1]
            rows.append((kind.value, str(len(lengths)), f"{median:.1f}", f"{most:.1f}", f"{sum(lengths):.0f}"))
    outages = sum(one.is_outage for one in troubles)
    notes = (f"{outages} outages of up to {SHORT_S:.0f} s",)
    return Table(title, ("trouble", ">times", ">median s", ">longest s", ">together s"), rows, notes)


def _phases(chance: random.Random, seconds: float) -> Iterator[tuple[float, float, Phase]]:
    begin = 0.0
    while begin < seconds:
        (phase,) = chance.choices(PHASES, [phase.weight for phase in PHASES])
        end = begin + 60.0 * chance.uniform(*phase.minutes)
        yield begin, end, phase
        begin = end


def _trouble(chance: random.Random, kind: Kind, at_s: float) -> Trouble:
    rate = chance.choice(RATES_BIT_S) if kind is Kind.SLOW else 0
    return Trouble(at_s, kind, LENGTHS[kind].draw(chance), rate)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.proof.outage.pattern", description=__doc__.partition("\n")[0]
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--duration", type=float, default=1800.0, help="seconds of the cut (%(default)s)")
    wanted = parser.parse_args(arguments)
    whole = day(wanted.seed)
    part = cut(whole, wanted.duration)
    title = f"{wanted.duration:g} s of it, without the quiet"
    Screen().show([table(f"24 hours, seed {wanted.seed}", whole), table(title, part)])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
