"""Runs fuzzing programs, and says what each has found."""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

from asn1.backends.ros2.options import PROFILES
from tests.fuzz import build, corpus

PYTHON = "python"  # the names of the targets that are no message
CDR = "cdr"
MAX_LEN = 1400  # octets: what fits a packet of ITS-G5; longer inputs reach no other code
TIMEOUT_S = 10  # for one input: a hang
MEMORY_MB = 2048
# Each input is a new allocation, and what was freed is kept for a while to find who still reads it. The default, 256 MB, is touched
# anew all the time, and the codec frees nothing: 8 MB hold the last ten thousand inputs.
ASAN_OPTIONS = "quarantine_size_mb=8:thread_local_quarantine_size_kb=64:malloc_context_size=2"


class Outcome(NamedTuple):
    """inputs: how many were tried; finding: the last lines of a program that failed, else empty."""

    name: str
    inputs: int
    covered: int
    took_s: float
    finding: str

    @property
    def rate(self) -> int:
        """Inputs per second, the start of the program and the corpus among them."""
        return round(self.inputs / self.took_s)


def target(name: str, program: Path, folder: Path, args: argparse.Namespace) -> Outcome:
    """Run one program on its corpus and on new inputs."""
    learned = folder / "corpus" / name
    corpus.unpack(name, learned)
    findings = folder / "findings"
    findings.mkdir(parents=True, exist_ok=True)
    asan = ":".join((ASAN_OPTIONS, *filter(None, [os.environ.get("ASAN_OPTIONS")])))
    outcome = _run(name, [str(program)], [learned], findings, args, ASAN_OPTIONS=asan)
    if args.keep and not outcome.finding:
        _keep(name, program, learned, folder / "merged" / name)
    return outcome


def cdr_target(program: Path, folder: Path, names: list[str], args: argparse.Namespace) -> Outcome:
    """Every message as CDR; it starts with cdr.hex, and with the corpora of the messages in every profile.

    The first octet of an input says which message and profile, the second whether CDR follows or a message: see cdr.c.
    """
    findings = folder / "findings"
    findings.mkdir(parents=True, exist_ok=True)
    learned = folder / "corpus" / CDR
    learned.mkdir(parents=True, exist_ok=True)
    seeds = [bytes.fromhex(line) for line in Path(__file__).with_name("cdr.hex").read_text().split()]
    for number, name in enumerate(name for name in sorted(names) for _ in PROFILES):
        seeds += [bytes([number, 1]) + octets for octets in corpus.read(name)]
    for seed in seeds:
        (learned / hashlib.sha1(seed).hexdigest()).write_bytes(seed)
    return _run(CDR, [str(program)], [learned], findings, args, ASAN_OPTIONS=ASAN_OPTIONS)


def python_target(module: Path, folder: Path, names: list[str], args: argparse.Namespace) -> Outcome:
    """The same for the Python module in a folder, by atheris; it starts with the corpora of the messages of these names."""
    findings = folder / "findings"
    findings.mkdir(parents=True, exist_ok=True)
    learned = folder / "corpus" / PYTHON
    corpus.unpack(PYTHON, learned)
    for number, name in enumerate(sorted(names)):
        for octets in corpus.read(name):
            seed = bytes([number, 0]) + octets  # what python.one_input makes of the two
            (learned / hashlib.sha1(seed).hexdigest()).write_bytes(seed)
    return _run(PYTHON, [sys.executable, "-m", "tests.fuzz.python"], [learned], findings, args, **build.preload(module))


def progress(one: Outcome, done: int, count: int) -> None:
    """A line as soon as a target is done."""
    outcome = "FINDING" if one.finding else "clean"
    print(
        f"fuzz: {done:2} of {count}: {one.name}: {one.inputs:,} inputs in {one.took_s:.0f} s, {one.rate:,}/s, {outcome}",
        file=sys.stderr,
    )


def report(outcomes: list[Outcome], goal: int, took_s: float) -> int:
    """A line per target, in the order of the messages, and the sum; 1 where there is a finding.

    goal    inputs per target; negative: none, the time ends it
    took_s  for all of them, side by side
    """
    print(f"\n{'target':24} {'inputs':>12} {'goal':>19} {'covered':>8} {'seconds':>8} {'inputs/s':>9}")
    for one in outcomes:
        outcome = "FINDING" if one.finding else "clean"
        print(
            f"{one.name:24} {one.inputs:12,} {_against(goal, one.inputs):>19} {one.covered:8,} {one.took_s:8.0f} "
            f"{one.rate:9,}  {outcome}"
        )
    findings = [one for one in outcomes if one.finding]
    short = sum(one.inputs < goal for one in outcomes)
    print(
        f"{len(outcomes)} targets, {sum(one.inputs for one in outcomes):,} inputs in {took_s / 60:.1f} min: "
        f"{len(findings)} with a finding, {short} short of the goal"
    )
    for one in findings:
        print(f"\n== {one.name}\n{one.finding}", file=sys.stderr)
    return 1 if findings else 0


def _against(goal: int, inputs: int) -> str:
    if goal < 0:
        return "none"
    return f"{goal:,} {'reached' if inputs >= goal else 'missed'}"


def _run(
    name: str, program: list[str], folders: list[Path], findings: Path, args: argparse.Namespace, **environment: str
) -> Outcome:
    options = [
        f"-runs={args.runs}", f"-seed={args.seed}", f"-max_total_time={args.seconds}", f"-max_len={MAX_LEN}",
        f"-timeout={TIMEOUT_S}", f"-rss_limit_mb={MEMORY_MB}", f"-artifact_prefix={findings}/{name}-",
        # -entropic: counts how often each edge was passed, for a fifth of the time; as many inputs reach no more by it.
        "-print_final_stats=1", "-reload=0", "-entropic=0", f"--every={args.every}",
    ]  # fmt: skip
    started = time.monotonic()
    done = subprocess.run([*program, *options, *map(str, folders)], capture_output=True, text=True,
                          errors="replace", check=False, cwd=corpus.ROOT, env={**os.environ, **environment})  # fmt: skip
    inputs = re.search(r"stat::number_of_executed_units:\s+(\d+)", done.stderr)
    covered = re.findall(r"cov: (\d+)", done.stderr)
    return Outcome(
        name,
        int(inputs[1]) if inputs else 0,
        int(covered[-1]) if covered else 0,
        time.monotonic() - started,
        _last_words(done) if done.returncode else "",
    )


def _last_words(done: subprocess.CompletedProcess[str]) -> str:
    """Python's traceback, which goes to stdout, and the end of stderr without the lines of libFuzzer's progress (#123 NEW ...)."""
    told = [line for line in done.stderr.splitlines() if not line.startswith("#")]
    return "\n".join((*done.stdout.splitlines()[-20:], *told[-60:]))


def _keep(name: str, program: Path, learned: Path, merged: Path) -> None:
    """The smallest set of inputs with the same coverage, into the committed corpus."""
    shutil.rmtree(merged, ignore_errors=True)
    merged.mkdir(parents=True)
    committed = [str(learned)]
    subprocess.run([str(program), "-merge=1", f"-max_len={corpus.MAX_OCTETS}", str(merged), *committed],
                   capture_output=True, check=True)  # fmt: skip
    corpus.write(name, [path.read_bytes() for path in merged.iterdir()])
