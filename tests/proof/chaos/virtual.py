"""Simulated minutes of trouble in virtual time: python -m tests.proof.chaos.virtual --minutes 30 --seeds 1 2 3."""

import argparse
import sys
import tempfile
import time
from pathlib import Path

import pytest

from drivers.sim.trouble import BOARD
from firmware.client.show.table import Screen
from tests.proof.chaos.run import TICK_S, Goal, Run, summary, timeline, worst
from tests.proof.chaos.stage import INTERFACES, Stage

START_S = 30.0  # the modem takes longest: 9 s
QUIET_S = 30.0  # before it is counted what is held, and after the last trouble
LINES_PER_TROUBLE = 12  # of the journal: a bring-up of the modem has ten
LINES = 60  # at most within Journal.WINDOW_S
SPARE_TIMERS = 3  # of who waits for something just then, and did not before


class VirtualRun:
    """One seed."""

    def __init__(self, seed: int, minutes: float, folder: Path, patch: pytest.MonkeyPatch) -> None:
        self._minutes = minutes
        self.stage = Stage(folder, patch, seed)
        self._seed = seed

    def play(self) -> list[Goal]:
        """All of it; what has to hold, and whether it does."""
        stage, loop = self.stage, self.stage.loop
        stage.start()
        names = (*INTERFACES, BOARD)
        loop.run_until(lambda: all(stage.is_up(name) for name in names), START_S)
        stage.flow()
        loop.run_for(QUIET_S)
        held, timers, lines = stage.held(), loop.pending(), len(stage.journal.lines)
        run = self.run = Run(stage, stage.station.config.board, self._seed)
        loop.every(TICK_S, run.tick)
        loop.run_for(60.0 * self._minutes)
        run.finish()
        loop.run_until(lambda: run.is_well or bool(run.overdue), 1000.0)
        loop.run_for(QUIET_S)
        timers = loop.pending() - timers - 1  # but for tick
        stage.end_flow()
        lines = len(stage.journal.lines) - lines
        return [
            *run.goals(),
            *self._flow(),
            Goal("as many sources and descriptors as before", f"{held}, {stage.held()}", held == stage.held()),
            Goal("no more timers than before", f"{timers:+d}", timers <= SPARE_TIMERS),
            Goal(
                f"at most {LINES_PER_TROUBLE} lines of the journal for each trouble",
                f"{lines} for {run.count}",
                lines <= LINES_PER_TROUBLE * max(1, run.count),
            ),
            Goal(
                f"at most {LINES} of them within {stage.journal.WINDOW_S:.0f} s",
                str(stage.journal.most),
                stage.journal.most <= LINES,
            ),
            Goal("never two drivers in one slot", ", ".join(stage.two_drivers) or "none", not stage.two_drivers),
            Goal("one process for each worker", ", ".join(stage.workers), stage.workers == ["sim-board", "som301e"]),
        ]

    def _flow(self) -> list[Goal]:
        stage = self.stage
        kept = {outcome: count for outcome, count in stage.outcomes.items() if outcome[0] == "g5"}
        return [
            Goal(
                "every message over the interface beside arrives",
                f"{stage.sent_in} in, {stage.requested} out",
                stage.sent_in == stage.heard_in
                and stage.requested == stage.heard_out == stage.outcomes["beside", "sent", ""],
            ),
            Goal(
                "each one for the radio has left or is accounted for",
                ", ".join(f"{count} {reason or outcome}" for (_, outcome, reason), count in sorted(kept.items())),
                sum(kept.values()) == stage.handed_to_radio,
            ),
        ]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.proof.chaos.virtual", description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0, help="simulated, of each seed")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1], help="one run for each")
    wanted = parser.parse_args(arguments)
    failed = False
    for seed in wanted.seeds:
        began = time.monotonic()
        with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
            one = VirtualRun(seed, wanted.minutes, Path(folder), patch)
            try:
                goals = one.play()
            finally:
                one.stage.close()
        title = f"{wanted.minutes:g} simulated minutes in {time.monotonic() - began:.0f} s, seed {seed}"
        Screen().show([timeline(one.run.episodes), worst(one.run.episodes), summary(title, goals)])
        failed |= not all(goal.is_met for goal in goals)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
