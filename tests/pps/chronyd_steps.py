"""Station between simulated receiver and real chronyd, with clock steps.

`captain run --board sim` runs in real time. Its pulses, receiver, socket and chronyc are those of a
user. libfaketime steps the station's system clock by half a millisecond forth and back. The oscillator, the receiver
and chronyd go on. Prints each result beside its goal; ends with 1 if a goal is missed. A minute and a half.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from firmware.client.show.table import Screen
from pps.chrony.tracking import Tracking
from tests.pps.chronyd import ROOT, Chronyd
from tests.proof.chaos.run import Goal, summary
from tests.system.ports import Ports
from tests.system.station import Station

# One sample per second: those before a step are forgotten after eight.
REFCLOCK = "refclock SOCK {socket} refid PPS poll 0 filter 1 maxsamples 8 precision 1e-7\n"
STEPS_NS = (500_000, 0, -500_000)  # of the system's clock, from where it began
LOCKED_S, SETTLED_S = 40, 40
SETTLED_NS = 10_000
LASTING = 8  # updates within it, one after the other
LOOK_S = 0.2


class Seen(NamedTuple):
    """What the station and chronyd say at a moment."""

    clock: Mapping[str, Any]
    tracking: Tracking


class Bench:
    """The two, and the file by which the station's clock is stepped."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._closing = ExitStack()
        self._shift = folder / "shift"
        own = folder / "chronyd"
        own.mkdir()
        self.chronyd = self._closing.enter_context(Chronyd(own, REFCLOCK))
        self.station = Station(folder, self._closing.enter_context(closing_ports()))
        interface = {"driver": "zed_f9p", "usb": "1-1.1", "slot": "gnss", "pulse": True}
        self.station.configure({"gnss": interface}, time={"chrony": str(self.chronyd.socket)})
        self._closing.callback(self.station.stop)
        self.step(0)
        with environment(self._environment()):
            self.station.start("--board", "sim")

    def step(self, ns: int) -> None:
        """Set the station's system clock so far ahead of the machine's; seen within a second."""
        self._shift.write_text(f"{ns / 1e9:+.9f}\n")

    def look(self) -> Seen:
        return Seen(self.station.ask(do="time")["clock"], self.chronyd.tracking())

    def until(self, is_so: Callable[[Seen], bool], within: float, lasting: int = 1) -> tuple[float | None, Seen]:
        """Seconds until something began to be so for that many updates of chronyd; None: it was not."""
        began = time.monotonic()
        since: dict[float, float] = {}  # update of chronyd -> when it was seen
        while True:
            now, seen = time.monotonic() - began, self.look()
            since = {seen.tracking.updated_unix_s: now, **since} if is_so(seen) else {}
            if len(since) >= lasting:
                return min(since.values()), seen
            if now > within + lasting:
                return None, seen
            time.sleep(LOOK_S)

    def close(self) -> None:
        self._closing.close()

    def _environment(self) -> dict[str, str]:
        """With a chronyc that asks this chronyd, and with a system clock that can be stepped."""
        programs = self._folder / "bin"
        programs.mkdir()
        chronyc = programs / "chronyc"
        command, *options = self.chronyd.chronyc
        chronyc.write_text(f'#!/bin/sh\nunset LD_PRELOAD\nexec {command} {" ".join(options)} "$@"\n')
        chronyc.chmod(0o755)
        (library,) = ROOT.glob("usr/lib/*/faketime/libfaketime.so.1")
        return {
            "PATH": f"{programs}:{os.environ['PATH']}",
            "LD_PRELOAD": str(library),
            "FAKETIME_TIMESTAMP_FILE": str(self._shift),
            "FAKETIME_CACHE_DURATION": "1",
            "DONT_FAKE_MONOTONIC": "1",
        }


@contextmanager
def closing_ports() -> Iterator[Ports]:
    ports = Ports()
    yield ports
    ports.release()


@contextmanager
def environment(more: Mapping[str, str]) -> Iterator[None]:
    """For what is started within."""
    before = dict(os.environ)
    os.environ.update(more)
    yield
    os.environ.clear()
    os.environ.update(before)


def goals(bench: Bench) -> Iterator[Goal]:
    took, seen = bench.until(
        lambda seen: seen.clock["state"] == "locked" and seen.tracking.reference == "PPS", LOCKED_S
    )
    what = f"the station is locked and chronyd has selected PPS within {LOCKED_S} s"
    yield Goal(what, f"{seen.clock['state']}, {seen.tracking.reference!r} after {shown(took)}", took is not None)
    bench.until(lambda seen: True, SETTLED_S, lasting=3 * LASTING)
    began_ns = bench.look().tracking.offset_ns or 0
    for step_ns in STEPS_NS:
        bench.step(step_ns)
        wanted_ns = began_ns - step_ns
        took, seen = bench.until(
            lambda seen, wanted=wanted_ns: abs((seen.tracking.offset_ns or 0) - wanted) < SETTLED_NS, SETTLED_S, LASTING
        )
        error_ns = (seen.tracking.offset_ns or 0) - wanted_ns
        what = f"within {SETTLED_NS // 1000} us after a step to {step_ns // 1000:+d} us"
        yield Goal(what, f"{error_ns / 1000:+.2f} us, after {shown(took)}", took is not None)
        apart_ns = abs((seen.clock["offset_ns"] or 0) - (seen.tracking.offset_ns or 0))
        told_ns = seen.clock["uncertainty_ns"] + (seen.tracking.uncertainty_ns or 0)
        what = "the station and chronyd agree within the bounds that they state"
        yield Goal(what, f"{apart_ns / 1000:.2f} us of {told_ns / 1000:.2f}", apart_ns <= told_ns)
    samples, pulse = seen.clock["refclock"]["samples"], seen.clock["pulse"]
    what = "every second that was passed on was sent, or its reason counted"
    yield Goal(what, f"{samples} of {pulse['seconds']}", sum(samples.values()) + pulse["late"] == pulse["seconds"])
    told = seen.clock["tracking"]
    yield Goal("the station knows what chronyd says", f"{told.get('reference')!r}", told.get("reference") == "PPS")


def shown(took: float | None) -> str:
    return "never" if took is None else f"{took:.0f} s"


def main() -> int:
    argparse.ArgumentParser(prog="python -m tests.pps.chronyd_steps", description=__doc__).parse_args()
    with tempfile.TemporaryDirectory(prefix="steps-") as folder, closing(Bench(Path(folder))) as bench:
        seen = list(goals(bench))
    Screen().show([summary("a running captain feeds chronyd", seen)])
    return 0 if all(goal.is_met for goal in seen) else 1


if __name__ == "__main__":
    sys.exit(main())
