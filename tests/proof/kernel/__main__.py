"""make kernel: the project's own code on real kernel interfaces, and a table of what was seen."""

import argparse
import compileall
import json
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from tests.proof.kernel.machine import BENCH, CONSOLE, PROJECT, booted

SILENCE_S = 240.0  # what takes longest waits a minute for each of three things, on a machine that has other work to do
GUESTS = 2  # a kernel that goes down in a check is not seen to go down in it again, unless the check is why
LAST_LINES = 120  # the kernel's own account of a mistake is 70
SOURCES = ("board", "drivers", "firmware", "pps", "tests")  # compiled here: emulated it takes ten times as long
RESULTS = BENCH / "results.json"


class Row(NamedTuple):
    """A check.

    seen     what it saw, in its own words; trouble, why it failed, is empty where it did not.
    """

    check: str
    seen: str
    seconds: float
    trouble: str

    @property
    def is_ok(self) -> bool:
        return not self.trouble

    def __str__(self) -> str:
        return f"{'ok' if self.is_ok else 'FAILED':6}  {self.seconds:5.1f} s  {self.check}" + (
            f"\n{'':17}{self.seen}" if self.seen else ""
        )


def main() -> int:
    parser = argparse.ArgumentParser(prog="make kernel", description=__doc__)
    parser.add_argument(
        "--only", metavar="WORDS", default="", help="checks whose names hold words, as pytest -k takes them"
    )
    parser.add_argument("--lab-s", metavar="S", type=float, default=5.0, help="of sending in the lab test (default 5)")
    arguments = parser.parse_args()
    options = [f"--lab-s={arguments.lab_s}", *(["-k", f"'{arguments.only}'"] if arguments.only else [])]
    for folder in SOURCES:
        compileall.compile_dir(PROJECT / folder, quiet=1)
    began = time.monotonic()
    rows = list(_shown(checked(options, SILENCE_S + arguments.lab_s)))
    took = time.monotonic() - began
    RESULTS.write_text(json.dumps([row._asdict() for row in rows], indent=1))
    failed = [row for row in rows if not row.is_ok]
    for row in failed:
        print(f"\n{row.check}:\n{row.trouble}", file=sys.stderr)
    print(f"{len(rows) - len(failed)} of {len(rows)} checks are ok, {took:.0f} s; rows: {RESULTS}, console: {CONSOLE}")
    return 1 if failed or not rows else 0


def _shown(rows: Iterable[Row]) -> Iterator[Row]:
    for row in rows:
        print(row, flush=True)
        yield row


def checked(options: Sequence[str], silence_s: float) -> Iterator[Row]:
    """A row for each check. Where a guest goes down another begins with the check that it went down in.

    options    of pytest, in the guest.
    silence_s  a guest that says nothing for so long has gone down.
    """
    owed: list[str] = []
    told = 0
    for number in range(1, GUESTS + 1):
        with booted([*options, f"--skip={told}"]) as guest:
            owed = []
            for said in _said(guest.lines(silence_s)):
                if "promised" in said:
                    owed = said["promised"]
                elif "exit" in said:
                    yield from (Row(check, "", 0.0, "the checks ended before it") for check in owed)
                    return
                else:
                    row = Row(**said)
                    owed.remove(row.check)
                    told += 1
                    yield row
        where = f"guest {number} went down in: {owed[0] if owed else 'its start'}"
        print(f"{where}; its last words:\n{_last_words()}", file=sys.stderr, flush=True)
    yield from (Row(check, "", 0.0, "the guest was off before it") for check in owed)
    yield Row("a guest comes to its end", "", 0.0, f"{GUESTS} did not; {where}")


def _said(lines: Iterable[str]) -> Iterator[dict[str, Any]]:
    """What is told of checks; all else is shown as it is."""
    for line in lines:
        try:
            yield json.loads(line)
        except ValueError:
            if line:
                print(line, file=sys.stderr)


def _last_words() -> str:
    return "\n".join(CONSOLE.read_text(errors="replace").splitlines()[-LAST_LINES:]) if CONSOLE.exists() else ""


if __name__ == "__main__":
    sys.exit(main())
