"""Benchmark of this tree beside an earlier commit, in alternating rounds.

usage: python -m tests.bench.before COMMIT [--rounds 7] [--starts 21]; make bench-before BEFORE=COMMIT

COMMIT is checked out and set up in build/bench/before, with a .venv and binaries of its own. Each round runs the earlier
tree, this one, and the earlier one again: A/A is its second figure to its first. Start: from the program's start until the
first message at a plain subscriber, of both forms of the binary.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median

from image.program.contents import layers
from tests import earlier
from tests.bench import measure, programs
from tests.bench.subject import Station

BATCHES = 1000
READY = "captain is ready"
COUNTED = """
import atexit, runpy, sys
atexit.register(lambda: print(len(sys.modules)))
runpy.run_module("firmware", run_name="__main__", alter_sys=True)
"""
FORMS = {"directory": "captain-dir/captain", "file": "captain"}
RECEPTION_GOAL, START_GOAL = 1.05, 1.05
MORE = 300_000  # octets that JSON in and out may take


def main() -> int:
    """Prints a line for each figure; 1 where a goal is missed."""
    parser = argparse.ArgumentParser(prog="python -m tests.bench.before", description=__doc__)
    parser.add_argument("commit")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--starts", type=int, default=21)
    options = parser.parse_args()
    programs.build()
    earlier.check_out(options.commit, "setup", "binary")
    held = [_modules(), _reception(options.rounds)]
    for name, form in FORMS.items():
        held.append(_start(name, form, options.starts))
        held.append(_size(name, form))
    return 0 if all(held) else 1


def _modules() -> bool:
    before, now = _imported(earlier.TREE), _imported(programs.ROOT)
    print(f"modules imported by a station that runs: {before} -> {now}, goal: not more: {_verdict(now <= before)}")
    return now <= before


def _imported(tree: Path) -> int:
    """How many modules a station has imported from its start to its end."""
    station = Station()
    command = [str(tree / ".venv" / "bin" / "python"), "-c", COUNTED, *station.command()[1:]]
    environment = {**os.environ, "PYTHONPATH": str(tree)}
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        if not any(READY in line for line in running.stderr):
            raise SystemExit(f"bench: the station of {tree} does not start")
        running.terminate()
        return int(running.stdout.read())


def _reception(rounds: int) -> bool:
    def run(tree: Path) -> float:
        command = [str(tree / ".venv" / "bin" / "python"), str(Path(__file__).with_name("reception.py")), str(BATCHES)]
        environment = {**os.environ, "PYTHONPATH": str(tree)}
        found = subprocess.run(command, cwd=tree, env=environment, stdout=subprocess.PIPE, text=True, check=True)
        return float(found.stdout) / 1000

    return _paired("link to indication, us", rounds, RECEPTION_GOAL, run, is_noise_allowed=False)


def _start(name: str, form: str, rounds: int) -> bool:
    def run(tree: Path) -> float:
        return 1000 * measure.first_message_s(Station(captain=str(tree / "build" / "binary" / form)))

    return _paired(f"start of the {name}, ms", rounds, START_GOAL, run, is_noise_allowed=True)


def _size(name: str, form: str) -> bool:
    before, now = (_octets(tree / "build" / "binary" / form) for tree in (earlier.TREE, programs.ROOT))
    is_held = now <= before + MORE
    what = f"size of the {name}: {before:,} -> {now:,} octets, {now - before:+,}"
    print(f"{what}, goal at most {MORE:+,}: {_verdict(is_held)}")
    return is_held


def _paired(what: str, rounds: int, goal: float, run: Callable[[Path], float], *, is_noise_allowed: bool) -> bool:
    """This tree's figure to the earlier one's, beside A/A, which is the most that a ratio may differ by chance."""
    taken = [(run(earlier.TREE), run(programs.ROOT), run(earlier.TREE)) for _ in range(rounds)]
    first, now = median(one[0] for one in taken), median(one[1] for one in taken)
    ratio = measure.ratio_of_medians([one[:2] for one in taken])
    noise = measure.ratio_of_medians([one[::2] for one in taken])
    is_held = ratio <= goal or (is_noise_allowed and ratio <= max(noise, 1 / noise))
    print(
        f"{what}: {first:.1f} -> {now:.1f}, ratio {ratio:.3f}, A/A {noise:.3f}, {rounds} rounds, goal {goal}: "
        f"{_verdict(is_held)}"
    )
    return is_held


def _octets(program: Path) -> int:
    """Of the file, or of the directory that it is in."""
    return layers.octets(program.parent) if program.parent.name == "captain-dir" else program.stat().st_size


def _verdict(is_held: bool) -> str:
    return "reached" if is_held else "MISSED"


if __name__ == "__main__":
    sys.exit(main())
