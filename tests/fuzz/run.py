"""Runs fuzzing programs, and says what each has found."""

import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from tests.fuzz import build, corpus

MAX_LEN = 1400  # octets: what fits a packet of ITS-G5; longer inputs reach no other code
TIMEOUT_S = 10  # for one input: a hang
MEMORY_MB = 2048


class Outcome(NamedTuple):
    """inputs: how many were tried; finding: the last lines of a program that failed, else empty."""

    name: str
    inputs: int
    covered: int
    finding: str


def target(name: str, program: Path, folder: Path, args: argparse.Namespace) -> Outcome:
    """Run one program on its corpus and on new inputs."""
    learned = folder / "corpus" / name
    corpus.unpack(name, learned)
    findings = folder / "findings"
    findings.mkdir(parents=True, exist_ok=True)
    outcome = _run(name, [str(program)], [learned], findings, args)
    if args.keep and not outcome.finding:
        _keep(name, program, learned, folder / "merged" / name)
    return outcome


def python_target(module: Path, folder: Path, args: argparse.Namespace) -> Outcome:
    """The same for the Python module in a folder, by atheris."""
    findings = folder / "findings"
    findings.mkdir(parents=True, exist_ok=True)
    learned = folder / "corpus" / "python"
    corpus.unpack("python", learned)
    return _run(
        "python", [sys.executable, "-m", "tests.fuzz.python"], [learned], findings, args, **build.preload(module)
    )


def report(outcomes: list[Outcome]) -> int:
    """A line per target; 1 where there is a finding."""
    print(f"\n{'target':28} {'inputs':>12} {'covered':>8}")
    for one in outcomes:
        print(f"{one.name:28} {one.inputs:12,} {one.covered:8,}  {'FINDING' if one.finding else 'clean'}")
    for one in outcomes:
        if one.finding:
            print(f"\n== {one.name}\n{one.finding}", file=sys.stderr)
    return 1 if any(one.finding for one in outcomes) else 0


def _run(
    name: str, program: list[str], folders: list[Path], findings: Path, args: argparse.Namespace, **environment: str
) -> Outcome:
    options = [
        f"-runs={args.runs}", f"-seed={args.seed}", f"-max_total_time={args.seconds}", f"-max_len={MAX_LEN}",
        f"-timeout={TIMEOUT_S}", f"-rss_limit_mb={MEMORY_MB}", f"-artifact_prefix={findings}/{name}-",
        "-print_final_stats=1", "-reload=0",
    ]  # fmt: skip
    print(f"fuzz: {name}", file=sys.stderr)
    done = subprocess.run([*program, *options, *map(str, folders)], capture_output=True, text=True,
                          errors="replace", check=False, cwd=corpus.ROOT, env={**os.environ, **environment})  # fmt: skip
    inputs = re.search(r"stat::number_of_executed_units:\s+(\d+)", done.stderr)
    covered = re.findall(r"cov: (\d+)", done.stderr)
    return Outcome(
        name,
        int(inputs[1]) if inputs else 0,
        int(covered[-1]) if covered else 0,
        "\n".join(done.stderr.splitlines()[-60:]) if done.returncode else "",
    )


def _keep(name: str, program: Path, learned: Path, merged: Path) -> None:
    """The smallest set of inputs with the same coverage, into the committed corpus."""
    shutil.rmtree(merged, ignore_errors=True)
    merged.mkdir(parents=True)
    committed = [str(learned)]
    subprocess.run([str(program), "-merge=1", f"-max_len={corpus.MAX_OCTETS}", str(merged), *committed],
                   capture_output=True, check=True)  # fmt: skip
    corpus.write(name, [path.read_bytes() for path in merged.iterdir()])
