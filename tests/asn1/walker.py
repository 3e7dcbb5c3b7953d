"""The walkers of the tables in a process of their own, over types written by hand, under ASan and UBSan."""

import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

RUNTIME = Path("asn1/runtime")
PROGRAM = Path("tests/asn1/runtime")
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
    """The program, made anew where a source is younger."""
    sources = sorted(RUNTIME.glob("src/*.c")) + [PROGRAM / "every.c", PROGRAM / "walk_main.c"]
    headers = [*RUNTIME.glob("src/*.h"), *RUNTIME.glob("include/captain/*.h"), *PROGRAM.glob("*.h")]
    newest = max(path.stat().st_mtime for path in headers)
    BUILD.mkdir(parents=True, exist_ok=True)
    objects = [BUILD / f"{source.stem}.o" for source in sources]
    old = [
        (source, made)
        for source, made in zip(sources, objects, strict=True)
        if not made.exists() or made.stat().st_mtime < max(newest, source.stat().st_mtime)
    ]
    program = BUILD / "walk"
    if old or not program.exists():
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(_compile, old))
        subprocess.run(["gcc", "-fsanitize=address,undefined", *objects, "-o", program], check=True)
    return program


def _compile(pair: tuple[Path, Path]) -> None:
    source, made = pair
    subprocess.run(["gcc", *FLAGS, "-c", source, "-o", made], check=True)


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
