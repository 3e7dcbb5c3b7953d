"""Pulses of the host at a real /dev/pps0, taken by pps/device.py: each one, once, in order, and when."""

import json
import statistics
from itertools import pairwise
from typing import Any

from pps.pulse import Clocks, Pulse
from tests.proof.clock.bench import Bench, Pulser, Struck, bench
from tests.proof.clock.machine import Guest, Kind
from tests.proof.clock.rows import Row
from tests.proof.clock.truth import Truth

ITS_S = 700_000_000  # whatever it is: here nobody asks which second it is
EXCHANGE_S = 0.11  # between two looks at the guest's clocks, which no second is a multiple of
START_S = 60.0
SHARP_NS = 1_000_000  # QEMU took no longer for a pulse: else this machine was too busy to say when it gave it
GOAL_DEVIATION_US = 250.0  # 150 were seen on a quiet machine
GOAL_LATE_US = 2000.0


class Taken:
    """What the guest says of its pulses, and what the host knows of them."""

    def __init__(self) -> None:
        self.is_ready = False
        self.pulses: list[Pulse] = []
        self.struck: list[Struck] = []
        self.missed = 0
        self.others: list[str] = []

    def line(self, text: str) -> None:
        try:
            said: dict[str, Any] = json.loads(text)
        except ValueError:
            self.others.append(text)
            return
        if "pulse" in said:
            self.pulses.append(Pulse(*said["pulse"]))
        elif "ready" in said:
            self.is_ready = True
        elif "missed" in said:
            self.missed += said["missed"]
        else:
            self.others.append(text)


def measure(made: Kind, count: int) -> list[Row]:
    """So many pulses, a second apart, then the rows."""
    truth = Truth(ITS_S)
    taken = Taken()
    with bench(truth) as on:
        truth.start()
        guest = Guest(on.loop, made, "pulses", on.folder, "2026-06-01T08:00:00")
        on.boot(guest)
        on.wait_for_guests()
        guest.told["pulses"] = taken.line
        guest.start("pulses", *made.python, "-m", "tests.proof.clock.guest.pulses", "/dev/pps0")
        on.until(lambda: taken.is_ready or guest.trouble or taken.others, START_S, "the source of pulses")
        if not taken.is_ready:
            return [Row("pulses", "a source at /dev/pps0", "none", "; ".join([*taken.others, *guest.trouble]))]
        guest.hurry()
        _exchange(on, guest)
        on.pulser = Pulser(on.loop, truth, [guest.monitor], lambda struck: taken.struck.append(struck[0]))
        on.until(lambda: len(taken.struck) >= count, 2.0 * count + 30, f"{count} pulses")
        on.pulser.is_on = False
        on.turn_for(1.0)
        return _rows(taken, guest)


def _exchange(on: Bench, guest: Guest) -> None:
    def again(_: Clocks) -> None:
        on.loop.after(EXCHANGE_S, lambda: guest.clocks(again))

    guest.clocks(again)


def _rows(taken: Taken, guest: Guest) -> list[Row]:
    # The kernel counts edges from its start on, of which the bench gave the first.
    pairs = [(taken.struck[pulse.sequence - 1], pulse) for pulse in taken.pulses if pulse.sequence <= len(taken.struck)]
    for struck, pulse in pairs:
        guest.ruler.after(struck.at_ns.earliest, pulse.raw_ns)
    known_us = guest.ruler.host(0).half / 1000
    sharp = [pair for pair in pairs if pair[0].at_ns.half * 2 <= SHARP_NS]
    late_us = [(guest.ruler.host(pulse.raw_ns).middle - struck.at_ns.earliest) / 1000 for struck, pulse in sharp]
    deviation_us = statistics.pstdev(late_us) if sharp else float("nan")
    follow = list(pairwise(taken.pulses))
    in_order = all((after.sequence - before.sequence) % 2**32 == 1 for before, after in follow)
    is_caused = all(guest.ruler.host(pulse.raw_ns).latest >= struck.at_ns.earliest for struck, pulse in pairs)
    apart_us = max((abs(_apart_ns(before, after)) / 1000 for before, after in follow), default=0.0)
    return [
        Row.of(
            "pulses taken of those given, in the order of their sequence",
            f"{len(taken.pulses)} of {len(taken.struck)}, {taken.missed} missed"
            + ("" if in_order else ", out of order"),
            "all",
            len(taken.pulses) == len(taken.struck) and in_order and not taken.missed and not taken.others,
        ),
        Row.of(
            f"stamp after the host's moment: standard deviation, of the {len(sharp)} that QEMU gave within 1 ms",
            f"{deviation_us:.0f} us",
            f"at most {GOAL_DEVIATION_US:.0f} us",
            deviation_us <= GOAL_DEVIATION_US,
        ),
        Row.of(
            "the same: least, median and most",
            ", ".join(f"{value:.0f}" for value in (min(late_us), statistics.median(late_us), max(late_us)))
            + f" us, to {known_us:.0f} us",
            f"at most {GOAL_LATE_US:.0f} us",
            max(late_us) <= GOAL_LATE_US,
        )
        if sharp
        else Row("the same: least, median and most", "none", "some", "the machine is too busy to give pulses in time"),
        Row.of("no stamp is before its cause, whenever that was", "none" if is_caused else "some", "none", is_caused),
        Row.of(
            "found on the oscillator: its second less that of the stamps",
            f"{apart_us:.1f} us at most",
            "20 us",
            apart_us < 20,
        ),
        Row.of(
            "the guest's oscillator is the host's clock",
            "yes" if guest.ruler.is_sound else "no",
            "yes",
            guest.ruler.is_sound,
        ),
    ]


def _apart_ns(before: Pulse, after: Pulse) -> int:
    """By how much the second between two pulses differs by the two clocks that each is told by."""
    return (after.system_ns - before.system_ns) - (after.raw_ns - before.raw_ns)
