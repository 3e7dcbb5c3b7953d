"""Station on the simulated board, with failures of every part.

usage: python -m tests.proof.chaos [--duration 600] [--seed 1] [--keep-journal FILE]

The simulators fail at random for that long. Ten messages a second go each way over the radio and over the interface
beside it, and all are accounted for. Ends with 1 when a goal is not met.
"""

import argparse
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from drivers.sim.trouble import BOARD
from firmware.client.show.table import Screen, Table
from firmware.commands import board
from tests.proof.chaos.patient import LIVELY, QUICK, Episode
from tests.proof.chaos.process import ROOT, Ports, Sample, StationProcess
from tests.proof.chaos.run import TICK_S, Goal, Run, summary, timeline, worst
from tests.proof.chaos.stage import INTERFACES
from tests.proof.chaos.traffic import BESIDE, RADIO, RATE_HZ, USER, Traffic
from tests.proof.chaos.virtual import LINES_PER_TROUBLE
from tests.system.ports import Ports as Free

UP_S = 60.0
SAMPLE_S = 1.0
QUIET_S = 5.0  # after the last trouble, until it is counted what is held
RECOVER_S = 400.0  # longer than any limit
SHORT_S = 60.0  # a run below that has short troubles, one soon after the other
DELAY_S = 1.0  # that a message over the interface beside may take on a busy machine

# Resident memory, of a straight line through the samples of the second half: what an allocator does, no leak.
FLAT_KB_PER_MIN = 100.0
SETTLED_S = 300.0  # a shorter run shows how tables fill, not what grows

Act = Callable[[], None]


class RealRun:
    """One run."""

    def __init__(self, station: StationProcess, traffic: Traffic, seed: int, duration: float) -> None:
        self.samples: list[Sample] = []
        self._station = station
        self._traffic = traffic
        self._seed = seed
        self._duration = duration

    def play(self) -> None:
        """Trouble for the whole duration, then until everything is back."""
        self._turn(lambda: None, QUIET_S)
        pace = QUICK if self._duration < SHORT_S else LIVELY
        run = self.run = Run(self._station, self._station.hardware, self._seed, pace)
        self._turn(run.tick, self._duration)
        run.finish()
        self._turn(run.tick, RECOVER_S, lambda: run.is_well or bool(run.overdue))
        self._turn(lambda: None, QUIET_S)
        self._traffic.listen(DELAY_S)

    def _turn(self, tick: Act, longest_s: float, is_over: Callable[[], bool] = lambda: False) -> None:
        """Messages, samples and tick, each at its pace, for so long."""
        end = time.monotonic() + longest_s
        every = {self._traffic.send: 1 / RATE_HZ, tick: TICK_S, self._sample: SAMPLE_S}
        due = dict.fromkeys(every, 0.0)
        while (now := time.monotonic()) < end and not is_over():
            for act, at in due.items():
                if now >= at:
                    act()
                    due[act] = max(at + every[act], now)
            self._traffic.listen(max(0.001, min(due.values()) - time.monotonic()))

    def _sample(self) -> None:
        self.samples.append(self._station.sample())

    # what has to hold

    def goals(self) -> list[Goal]:
        return [*self.run.goals(), *self._beside(), *self._by_radio(), *self._flat()]

    def _beside(self) -> list[Goal]:
        traffic = self._traffic
        sent, heard = traffic.of(BESIDE), traffic.heard["user"].keys() & traffic.of(BESIDE).keys()
        out, arrived = traffic.of(USER), traffic.heard["beside"]
        times = [at - sent[number] for number, at in traffic.heard["user"].items() if number in sent]
        slowest = max([*times, *(at - out[number] for number, at in arrived.items())])
        confirms = traffic.confirms
        is_out = len(out) == len(arrived) == confirms["beside", "accepted", ""] == confirms["beside", "sent", ""]
        return [
            Goal(
                "every message over the interface beside arrives",
                f"in {len(heard)} of {len(sent)}, out {len(arrived)} of {len(out)}",
                len(heard) == len(sent) and is_out,
            ),
            Goal(f"each of these takes less than {DELAY_S:g} s", f"{slowest * 1000:.0f} ms", slowest < DELAY_S),
            Goal("none is heard twice or by nobody's sending", str(traffic.strange), traffic.strange == 0),
        ]

    def _by_radio(self) -> list[Goal]:
        """Out: each message that was handed over has left or was dropped with a reason. In: lost only in trouble."""
        traffic = self._traffic
        kept = {key[1:]: count for key, count in traffic.confirms.items() if key[0] == "g5"}
        accepted = kept.pop(("accepted", ""), 0)
        left = kept.get(("sent", ""), 0)
        heard = len(traffic.heard["g5"])
        # One whose process ended in the middle may have left, and is said to be dropped.
        troubles = sum(one.troubles.count(",") + 1 for one in self._of_radio())
        sent = traffic.of(RADIO)
        lost = [number for number in sent if number not in traffic.heard["user"]]
        outside = [number for number in lost if not self._is_excused(sent[number])]
        said = ", ".join(f"{count} {reason or outcome}" for (outcome, reason), count in sorted(kept.items()))
        return [
            Goal(
                "each message for the radio has left or is accounted for",
                f"{accepted} = {said}; heard {heard}",
                accepted == sum(kept.values()) and left <= heard <= left + 8 * troubles,
            ),
            Goal(
                "what comes by radio is lost only while that has trouble",
                f"{len(sent) - len(lost)} of {len(sent)} received, {len(outside)} lost without",
                not outside,
            ),
        ]

    def _of_radio(self) -> list[Episode]:
        return [one for one in self.run.episodes if INTERFACES.get(one.name) == "g5"]

    def _is_excused(self, at: float) -> bool:
        """Whether the radio had trouble at a moment, or a tick before."""
        at -= self.run.began
        return any(one.at_s - TICK_S <= at <= one.at_s + one.lasted_s + one.back_s + TICK_S for one in self._of_radio())

    def _flat(self) -> list[Goal]:
        samples, run = self.samples, self.run
        first, last = samples[0], samples[-1]
        before, after = _held(samples[: int(QUIET_S)]), _held(samples[-int(QUIET_S) :])
        slope = _slope(samples[len(samples) // 2 :])
        is_long = self._duration >= SETTLED_S
        journal = self._station.journal()
        lines = len(journal.splitlines())
        memory = f"{first.memory_kb} to {last.memory_kb} kB, {slope:+.0f} kB/min in the second half"
        children = [one.children_kb for one in samples]
        return [
            Goal(
                "memory is flat",
                memory if is_long else f"{memory}: too short to tell",
                not is_long or slope < FLAT_KB_PER_MIN,
            ),
            Goal(
                "that of its workers too",
                f"{statistics.median(children[:60])} to {statistics.median(children[-60:])} kB",
                not is_long or statistics.median(children[-60:]) < 1.1 * statistics.median(children[:60]),
            ),
            Goal(
                "as many descriptors and workers as before",
                f"{before}, {after}; at most {max(one.descriptors for one in samples)} descriptors",
                before == after,
            ),
            Goal(
                f"at most {LINES_PER_TROUBLE} lines of the journal for each trouble, no traceback",
                f"{lines} for {run.count}",
                lines <= LINES_PER_TROUBLE * (run.count + 4) and "Traceback" not in journal,
            ),
            Goal(
                "it answers within a second at all times",
                f"{self._station.slowest_answer_s * 1000:.0f} ms",
                self._station.slowest_answer_s < 1.0,
            ),
        ]


def _held(samples: Sequence[Sample]) -> tuple[int, int]:
    """Descriptors and workers, most of the time: each question has one of its own."""
    return statistics.mode((one.descriptors, one.children) for one in samples)


def _slope(samples: Sequence[Sample]) -> float:
    """Of resident memory, kB per minute."""
    if len(samples) < 3:
        return 0.0
    line = statistics.linear_regression([one.at_s for one in samples], [one.memory_kb for one in samples])
    return 60.0 * line.slope


def start_up(station: StationProcess, names: Sequence[str]) -> Table:
    """Wait until everything is up; the time line of that."""
    end = time.monotonic() + UP_S
    while not all(station.is_up(name) for name in names):
        if time.monotonic() > end:
            raise RuntimeError(f"not everything has come up within {UP_S:.0f} s:\n{station.journal()}")
        time.sleep(TICK_S)
    answer: Mapping[str, object] = station.ask(do="board")
    *_, table = board.tables(answer)
    return table._replace(title="from power on to every module up")


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.proof.chaos", description=__doc__.partition("\n")[0])
    parser.add_argument("--duration", type=float, default=600.0, help="seconds of trouble (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of what fails when (%(default)s)")
    parser.add_argument("--keep-journal", type=Path, help="what the station has said goes there")
    wanted = parser.parse_args(arguments)
    subprocess.run([ROOT / ".ci" / "sim"], check=True)
    free = Free()
    station = StationProcess(Ports(*(free.take() for _ in Ports._fields)))
    screen = Screen()
    try:
        station.start()
        screen.show([start_up(station, (*INTERFACES, BOARD))])
        traffic = Traffic(station.ports)
        traffic.join()
        one = RealRun(station, traffic, wanted.seed, wanted.duration)
        one.play()
        goals = one.goals()
        traffic.close()
        goals.append(Goal("it stops as it is told", f"exit code {(code := station.stop())}", code == 0))
        if wanted.keep_journal:
            wanted.keep_journal.write_text(station.journal())
    finally:
        station.close()
        free.release()
    title = f"{wanted.duration:g} s of trouble, seed {wanted.seed}: {one.run.count} troubles"
    screen.show([timeline(one.run.episodes), worst(one.run.episodes), summary(title, goals)])
    return int(not all(goal.is_met for goal in goals))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
