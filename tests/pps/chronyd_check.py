"""Real chronyd with the image's configuration, its clock 20 times faster.

usage: python -m tests.pps.chronyd_check [--rate 20] [--seed 1] [--refclock "poll 3 filter 8"]

The truth wanders as an oscillator does, and stamps have noise. One pulse in 50 is late, and the clock is off by half
a millisecond twice. Prints each result beside its goal; ends with 1 if a goal is missed. With --rate 1 chronyd's
clock is the machine's, and it takes 20 times as long: eleven minutes.
"""

import argparse
import itertools
import logging
import random
import re
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from board.time.scales import EPOCH, LEAPS, LeapEvent
from firmware.client.show.table import Screen
from pps.chrony.configuration import refclock
from pps.chrony.feed import Fate
from pps.chrony.tracking import Tracking
from tests.pps.chronyd import Chronyd, Feeder, event, shift_to
from tests.proof.chaos.run import Goal, summary

NOISE_NS = 1_000  # standard deviation of a stamp on a Pi 4 (rascol/PPS-Client: 0.6 us and more)
LATE_NS = 30_000  # on average, of the pulses that an interrupt in progress holds up
LATE_SHARE = 0.02
WANDER_PPB = 5.0  # of the frequency, each second: a crystal without a case in moving air
STEP_NS = 500_000
STEPS = {0: 0, 240: STEP_NS, 360: 0, 480: -STEP_NS}  # chronyd's seconds -> what the clock is off by
END_S = 600
AGO_NS = 1_500_000_000  # a pulse is told: more than chronyd's clock, which starts later, is behind

SELECTED_S = 20
SETTLED_S = 60
SETTLED_NS = 10_000
INSIDE = 0.99
COST_US = 50
SAMPLES = 1000


class Seen(NamedTuple):
    """What chronyd said: when, and truth less system's clock as it really was and as chronyd had it."""

    second: int
    truth_ns: float
    tracking: Tracking

    @property
    def error_ns(self) -> float:
        return self.tracking.system_offset_s * 1e9 - self.truth_ns


class Truth:
    """True time less the system's clock, of each second."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._frequency_ppb = 0.0
        self._wandered_ns = 0.0

    def advance(self) -> None:
        self._frequency_ppb += self._random.gauss(0, WANDER_PPB)
        self._wandered_ns += self._frequency_ppb

    def offset_ns(self, second: int) -> float:
        return self._wandered_ns + STEPS[max(start for start in STEPS if start <= second)]

    def lateness_ns(self) -> float:
        """Of a stamp."""
        late_ns = self._random.expovariate(1 / LATE_NS) if self._random.random() < LATE_SHARE else 0.0
        return self._random.gauss(0, NOISE_NS) + late_ns


def play(chronyd: Chronyd, feeder: Feeder, seed: int) -> list[Seen]:
    """Feed it a sample at each of its seconds, and ask it at every other."""
    truth = Truth(seed)
    seen = []
    began = time.monotonic()
    for second in range(END_S):
        time.sleep(max(0.0, began + second / chronyd.rate - time.monotonic()))
        truth.advance()
        feeder.offset_ns = round(truth.offset_ns(second) - truth.lateness_ns())
        feeder(AGO_NS)
        if second % 2:
            seen.append(Seen(second, truth.offset_ns(second), chronyd.tracking()))
    return seen


def settled_after(seen: Sequence[Seen], start: int, end: int) -> int | None:
    """Seconds from a step until chronyd is and stays within SETTLED_NS, for 95 of 100 answers; None when it does not."""
    part = [one for one in seen if start <= one.second < end]
    for number, one in enumerate(part):
        rest = part[number:]
        if len(rest) >= 10 and sum(abs(one.error_ns) < SETTLED_NS for one in rest) >= 0.95 * len(rest):
            return one.second - start
    return None


def disciplined(seen: Sequence[Seen]) -> list[Goal]:
    """What chronyd has made of the samples."""
    first = next((one.second for one in seen if one.tracking.reference == "PPS"), None)
    goals = [Goal(f"selected within {SELECTED_S} s", f"{first} s", first is not None and first <= SELECTED_S)]
    _, *steps = itertools.pairwise([*STEPS, END_S])
    for start, end in steps:
        took = settled_after(seen, start, end)
        what = f"within {SETTLED_NS // 1000} us {SETTLED_S} s after a step to {STEPS[start] // 1000:+d} us"
        goals.append(Goal(what, "never" if took is None else f"{took} s", took is not None and took <= SETTLED_S))
    steady = [one for one in seen if 120 <= one.second < 240]
    errors = sorted(abs(one.error_ns) for one in steady)
    worst = errors[int(0.95 * len(errors))]
    what = f"95 % of errors before the first step below {SETTLED_NS // 1000} us"
    goals.append(Goal(what, f"{worst / 1000:.2f} us, median {errors[len(errors) // 2] / 1000:.2f}", worst < SETTLED_NS))
    bounds_ns = [one.tracking.uncertainty_ns or 0 for one in steady]
    inside = sum(abs(one.error_ns) <= bound for one, bound in zip(steady, bounds_ns, strict=True)) / len(steady)
    seen_of_bound = f"{inside:.1%}, median bound {statistics.median(bounds_ns) / 1000:.1f} us"
    goals.append(Goal(f"truth inside chronyd's own bound in {INSIDE:.0%}", seen_of_bound, inside >= INSIDE))
    return goals


def leaps(make: Callable[..., Chronyd]) -> list[Goal]:
    """A leap second announced on the last day of the year, and on the day before."""
    return [
        announced(make, "2030-12-31T12:00:00", event("2031-01-01", 1), "Insert second"),
        announced(make, "2030-12-30T12:00:00", event("2031-01-01", 1), "Normal"),
    ]


def announced(make: Callable[..., Chronyd], now: str, leap: LeapEvent, said: str) -> Goal:
    with make(shift_s=shift_to(now)) as chronyd:
        fed = Feeder(chronyd)
        fed.leap = leap
        for second in range(40):
            fed(AGO_NS)
            time.sleep(1 / chronyd.rate)
            if second > 20 and (state := chronyd.tracking()).leap == said:
                break
    return Goal(
        f"on {now[:10]}, a leap second of {utc(leap)} is said as {said!r}", repr(state.leap), state.leap == said
    )


def utc(leap: LeapEvent) -> str:
    return time.strftime("%Y-%m-%d", time.gmtime(leap.its_s + EPOCH - len(LEAPS) - 1))


def cost(chronyd: Chronyd, feeder: Feeder) -> list[Goal]:
    """Of one sample on the loop, also while chronyd hangs."""
    goals = [costs(feeder, "that is taken")]
    chronyd.freeze()
    goals.append(costs(feeder, "while chronyd hangs"))
    chronyd.thaw()
    counts = feeder.refclock.counts
    told = ", ".join(f"{count} {fate}" for fate, count in counts.items())
    is_whole = sum(counts.values()) == END_S + 2 * SAMPLES and counts[Fate.FULL] > 0
    return [*goals, Goal("every sample is counted", told, is_whole)]


def costs(feeder: Feeder, what: str) -> Goal:
    took_us = []
    for _ in range(SAMPLES):
        began = time.perf_counter_ns()
        feeder(AGO_NS)
        took_us.append((time.perf_counter_ns() - began) / 1000)
    took_us.sort()
    usual, seldom = took_us[SAMPLES // 2], took_us[SAMPLES * 99 // 100]
    return Goal(f"a sample {what} costs below {COST_US} us", f"{usual:.0f} us, 99 %: {seldom:.0f}", usual < COST_US)


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rate", type=int, default=20, help="how much faster chronyd's clock goes")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--refclock", default="", help="other options of the refclock, to compare")
    asked = options.parse_args()
    logging.basicConfig(level=logging.ERROR)
    text = refclock("/socket").replace("/socket", "{socket}")
    if asked.refclock:
        text = re.sub(r"poll \d+ filter \d+", asked.refclock, text)

    with tempfile.TemporaryDirectory(prefix="chronyd-") as folder:

        def make(shift_s: int = 0) -> Chronyd:
            return Chronyd(Path(tempfile.mkdtemp(dir=folder)), text, shift_s=shift_s, rate=asked.rate)

        with make() as chronyd:
            feeder = Feeder(chronyd)
            goals = disciplined(play(chronyd, feeder, asked.seed)) + cost(chronyd, feeder)
        goals += leaps(make)
    Screen().show([summary(f"chronyd: {text.splitlines()[-1]}", goals)])
    return 0 if all(goal.is_met for goal in goals) else 1


if __name__ == "__main__":
    sys.exit(main())
