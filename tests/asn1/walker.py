"""The walkers of the tables in processes of their own, under ASan and UBSan."""

import os
import subprocess
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

RUNTIME = Path("asn1/backends/c/runtime")
PROGRAM = Path("tests/asn1/backends/c/runtime")
BUILD = Path("build/asn1-runtime")
FLAGS = (
    "-std=c11", "-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all",
    "-Wall", "-Wextra", "-Werror", f"-I{RUNTIME / 'include'}",
)  # fmt: skip


class Refusal(NamedTuple):
    """What a report says."""

    status: str
    bit: int
    path: str
    text: str


class Step(NamedTuple):
    """One step of captain_explain."""

    what: str
    bit: int
    width: int
    path: str
    text: str
    clause: str


def build() -> Path:
    """The program that asks the walkers about types written by hand."""
    return _linked(BUILD / "walk", [*_runtime(), PROGRAM / "every.c", PROGRAM / "walk_main.c"], [PROGRAM / "every.h"])


def build_comparison(name: str, generated: Sequence[Path], program: str = "messages") -> Path:
    """The program that compares the walkers with generated code. name: a folder for what is made."""
    folder = next(path.parent for path in generated if path.suffix == ".c")
    sources = [*_runtime(), PROGRAM / f"{program}_main.c", *(path for path in generated if path.suffix == ".c")]
    headers = [path for path in generated if path.suffix == ".h"]
    return _linked(BUILD / name / program, sources, headers, f"-I{folder.parent / 'include'}", f"-I{RUNTIME / 'src'}")


def _runtime() -> list[Path]:
    return sorted(RUNTIME.glob("src/*.c"))


def _linked(program: Path, sources: Sequence[Path], headers: Sequence[Path], *flags: str) -> Path:
    """The objects of the runtime lie in one folder for all programs; what is older than a source or header is made anew."""
    program.parent.mkdir(parents=True, exist_ok=True)
    of_runtime = _newest([*RUNTIME.glob("src/*.h"), *RUNTIME.glob("include/captain/*.h")])
    of_all = max(of_runtime, _newest(headers))
    jobs: list[tuple[Path, Path, tuple[str, ...]]] = []
    objects: list[Path] = []
    for source in sources:
        is_runtime = RUNTIME in source.parents
        made = (BUILD if is_runtime else program.parent) / f"{source.stem}.o"
        objects.append(made)
        if not made.exists() or made.stat().st_mtime < max(
            of_runtime if is_runtime else of_all, source.stat().st_mtime
        ):
            jobs.append((source, made, flags))
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(_compile, jobs))
    if jobs or not program.exists() or program.stat().st_mtime < _newest(objects):
        subprocess.run(["gcc", "-fsanitize=address,undefined", *objects, "-o", program], check=True)
    return program


def _newest(paths: Sequence[Path]) -> float:
    return max((path.stat().st_mtime for path in paths), default=0.0)


def _compile(job: tuple[Path, Path, tuple[str, ...]]) -> None:
    source, made, flags = job
    subprocess.run(["gcc", *FLAGS, *flags, "-c", source, "-o", made], check=True)


class Walker:
    """Asks one question a line; an answer ends with a point on a line of its own."""

    def __init__(self, program: Path) -> None:
        self._process = subprocess.Popen([program], stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def close(self) -> None:
        """Ends the process. Raises AssertionError where it had failed."""
        self._process.communicate()
        assert self._process.returncode == 0

    def ask(self, verb: str, type_name: str, argument: bytes | str) -> str:
        """The answer, without its end. Raises AssertionError where the program dies: a sanitizer has said why."""
        octets = argument.encode() if isinstance(argument, str) else argument
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin
        assert stdout
        assert not {0, ord("\n")} & set(octets)
        stdin.write(f"{verb} {type_name} ".encode() + octets + b"\n")
        stdin.flush()
        lines: list[bytes] = []
        while (line := stdout.readline()) != b".\n":
            assert line, f"the program died at: {verb} {type_name} {argument!r}"
            lines.append(line)
        return b"".join(lines).decode()

    def json(self, type_name: str, text: bytes | str) -> str | Refusal:
        """What is written of what was read."""
        return _answer(self.ask("json", type_name, text))

    def check(self, type_name: str, text: str) -> Refusal:
        """What the check of every constraint says."""
        answer = _answer(self.ask("check", type_name, text))
        assert isinstance(answer, Refusal)
        return answer

    def explain(self, type_name: str, octets: str) -> tuple[list[Step], Refusal]:
        """octets: hexadecimal."""
        *lines, last = self.ask("explain", type_name, octets).splitlines()
        refusal = _answer(last)
        assert isinstance(refusal, Refusal)
        return [_step(line) for line in lines], refusal


def _answer(line: str) -> str | Refusal:
    fields = line.rstrip("\n").split("|", 3)
    if len(fields) < 4 or not fields[1].isdigit():
        return line.rstrip("\n")
    return Refusal(fields[0], int(fields[1]), fields[2], fields[3])


def _step(line: str) -> Step:
    what, place, rest = line.split(" ", 2)
    path, rest = rest.split(" [", 1)
    text, clause = rest.rsplit("] ", 1)
    bit, width = place.split("+")
    return Step(what, int(bit), int(width), path, text, clause)
