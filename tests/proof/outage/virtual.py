"""A day of a vehicle's network in virtual time: python -m tests.proof.outage.virtual --hours 24 --seeds 1 2."""

import argparse
import gc
import logging
import sys
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import pytest

from firmware.client.show.table import Screen, Table
from firmware.endpoint.report import memory_kb
from tests.proof.chaos.run import Goal, summary
from tests.proof.outage import messages, pattern, result, watch
from tests.proof.outage.messages import CAM_HZ, Schedule
from tests.proof.outage.pattern import Trouble
from tests.proof.outage.stage import TILED, TOLD, Route, Stage

ROUTES = (
    Route("qos1"),
    Route("qos1-bearer", has_bearer=True),
    Route("qos0", qos=0),
    Route("orange", profile=TILED),
    Route("orange-kept", profile=TILED, is_kept=True),
)

QUIET_S = 70.0  # after the last trouble, and before it is counted what is held: longer than any message is remembered
CLOSE_S = 5.0  # how often messages are closed whose time is over
LOOK_S = 1.0  # how often the subscriptions are compared with the place
SPARE_TIMERS = 6  # of who waits for something just then, and did not before
FLAT_KB = 4000  # resident memory, from a quarter of the run to its end: what an allocator does
FLAT_OBJECTS = 0.02  # of all that the garbage collector knows


class Held(NamedTuple):
    """What there is at a moment."""

    entries: dict[str, int]
    objects: int
    memory_kb: int


class VirtualRun:
    """One seed."""

    def __init__(
        self,
        seed: int,
        troubles: Sequence[Trouble],
        patch: pytest.MonkeyPatch,
        routes: Sequence[Route] = ROUTES,
        burst_s: float = messages.BURST_S,
        denm_s: float = messages.DENM_S,
    ) -> None:
        self.stage = Stage(patch, seed, routes)
        self._troubles = troubles
        self._schedule = Schedule(seed, burst_s, denm_s)
        self._number = 0
        self._is_sending = True
        self._seconds = (troubles[-1].end_s if troubles else 0.0) + QUIET_S

    def play(self) -> list[Goal]:
        """All of it; what has to hold, and whether it does."""
        stage, loop = self.stage, self.stage.loop
        stage.start()
        self._began = loop.now
        self._events = ((at_s, act, one) for one in self._troubles for at_s, act in _events(stage, one))
        self._follow()
        loop.every(1 / CAM_HZ, self._send)
        loop.every(CLOSE_S, self._close_old)
        loop.every(LOOK_S, stage.look)
        # A quarter, but never amid trouble.
        quarter = next((one.at_s for one in self._troubles if one.at_s > self._seconds / 4), self._seconds) - 0.05
        loop.run_for(quarter)
        before = self._held()
        loop.run_for(self._began + self._seconds - loop.now)
        self._is_sending = False
        loop.run_for(QUIET_S)
        is_connected = all(path.interface.is_up for path in stage.paths.values())
        for path in stage.paths.values():
            path.account.close_old(float("inf"))
        return [*self._accounts(), *self._flat(before, self._held()), Goal("all are connected", "", is_connected)]

    def _follow(self) -> None:
        """The next beginning or end of a trouble, at its time."""
        event = next(self._events, None)
        if event is not None:
            at_s, act, trouble = event
            self.stage.loop.after(self._began + at_s - self.stage.loop.now, lambda: (act(trouble), self._follow()))

    def _send(self) -> None:
        if not self._is_sending:
            return
        for envelope, count in self._schedule.due():
            for _ in range(count):
                self._number += 1
                self.stage.request(envelope, messages.pdu(envelope, self._number))

    def _close_old(self) -> None:
        for path in self.stage.paths.values():
            path.account.close_old(self.stage.loop.now)

    def _held(self) -> Held:
        gc.collect()
        return Held(self.stage.held(), len(gc.get_objects()), memory_kb())

    def _accounts(self) -> list[Goal]:
        stage = self.stage
        goals = [Goal("no request is refused", str(stage.refused), stage.refused == 0)]
        for path in stage.paths.values():
            goals += result.goals(path.account, stage.requests, path.kept.connections)
            goals += watch.goals(path.account.name, path.watch, TOLD if path.driver.bearer else frozenset())
            if path.followed is not None:
                goals.append(path.followed.goal(path.account.name))
            if path.is_kept:
                goals.append(
                    Goal(f"{path.account.name}: sessions are resumed", str(path.kept.resumed), path.kept.resumed > 0)
                )
        return goals

    def _flat(self, before: Held, after: Held) -> list[Goal]:
        entries = dict(after.entries)
        timers, children = entries.pop("timers") - before.entries["timers"], entries.pop("children")
        objects, memory = after.objects - before.objects, after.memory_kb - before.memory_kb
        return [
            Goal("nothing waits when all is over", str(entries), not any(entries.values())),
            Goal("one process for each interface", str(children), children == len(self.stage.paths)),
            Goal("no more timers than before", f"{timers:+d}", timers <= SPARE_TIMERS),
            Goal("no more objects", f"{before.objects} {objects:+d}", objects < FLAT_OBJECTS * before.objects),
            Goal("memory is flat", f"{before.memory_kb} {memory:+d} kB", memory < FLAT_KB),
        ]

    def tables(self) -> list[Table]:
        """What became of the messages, and how soon each path was back."""
        accounts = [path.account for path in self.stage.paths.values()]
        return [result.table(accounts), watch.table({name: path.watch for name, path in self.stage.paths.items()})]


def _events(stage: Stage, trouble: Trouble) -> tuple[tuple[float, Callable[[Trouble], None]], ...]:
    return (trouble.at_s, stage.begin), (trouble.end_s, stage.end)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.proof.outage.virtual", description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="simulated, of each seed")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1], help="one run for each")
    wanted = parser.parse_args(arguments)
    logging.getLogger("captain").setLevel(logging.CRITICAL)  # its journal would be of thousands of outages
    failed = False
    for seed in wanted.seeds:
        troubles = pattern.day(seed, 3600.0 * wanted.hours)
        began = time.monotonic()
        with pytest.MonkeyPatch.context() as patch:
            one = VirtualRun(seed, troubles, patch)
            try:
                goals = one.play()
                tables = one.tables()
            finally:
                one.stage.stop()
        took = time.monotonic() - began
        title = f"{wanted.hours:g} simulated hours in {took:.0f} s, seed {seed}, {one.stage.requests} messages"
        Screen().show([pattern.table(f"{wanted.hours:g} hours, seed {seed}", troubles), *tables, summary(title, goals)])
        failed |= not all(goal.is_met for goal in goals)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
