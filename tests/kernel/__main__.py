"""make kernel: the project's own code on real kernel interfaces, and a table of what was seen."""

import argparse
import compileall
import json
import sys
import time
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from tests.kernel.machine import BENCH, CONSOLE, PROJECT, booted

LIMIT_S = 900.0  # emulated on a busy machine it takes 3 minutes
LAST_LINES = 25
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
    with booted(options, LIMIT_S + arguments.lab_s) as guest:
        rows = list(_shown(_rows(guest.lines())))
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


def _rows(lines: Iterable[str]) -> Iterator[Row]:
    """Rows as the guest tells them, and one for each check that it promised and never told of."""
    promised: list[str] = []
    is_over = False
    for line in lines:
        try:
            said = json.loads(line)
        except ValueError:
            print(line, file=sys.stderr)
            continue
        if "promised" in said:
            promised = said["promised"]
        elif "exit" in said:
            is_over = True
        else:
            row = Row(**said)
            if row.check in promised:
                promised.remove(row.check)
            yield row
    for check in promised:
        yield Row(check, "", 0.0, "the guest was off before it")
    if not is_over:
        yield Row("the guest ends by itself", "", 0.0, f"it did not; its last words:\n{_last_words()}")


def _last_words() -> str:
    return "\n".join(CONSOLE.read_text(errors="replace").splitlines()[-LAST_LINES:]) if CONSOLE.exists() else ""


if __name__ == "__main__":
    sys.exit(main())
