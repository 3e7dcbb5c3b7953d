"""python -m tests: all tests, in parts side by side; with words, pytest's own."""

import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

HERE = Path(__file__).parent
# Beside these there is one more part, of all other folders. Each takes about as long: the first computes, the others wait
# for processes and sockets.
PARTS = (
    (
        "tests/asn1", "tests/board", "tests/drivers/wire", "tests/firmware/box", "tests/firmware/codec",
        "tests/firmware/console", "tests/gateway", "tests/image", "tests/meter", "tests/pps",
    ),
    ("tests/system",),
)  # fmt: skip

_SUMMARY = re.compile(r"(?:\d+ [a-z]+, )*\d+ [a-z]+ in [\d.]+s(?: \(\d+:\d\d:\d\d\))?\s*")
_FAILED = ("FAILED ", "ERROR ")  # of the short summary of a part


def main() -> int:
    """The exit code of the first part that went wrong, else 0. The last line is the sum of all."""
    if sys.argv[1:]:
        return subprocess.call([*_pytest(), *sys.argv[1:]], cwd=HERE.parent)
    began = time.monotonic()
    said: list[str] = []
    with ExitStack() as opened:
        parts = []
        for folders in PARTS:
            file = opened.enter_context(tempfile.TemporaryFile("w+"))
            command = [*_pytest(), *folders]
            parts.append((subprocess.Popen(command, cwd=HERE.parent, stdout=file, stderr=subprocess.STDOUT), file))
        others = [*_pytest(), *(f"--ignore={folder}" for folders in PARTS for folder in folders)]
        rest = subprocess.Popen(others, cwd=HERE.parent, stdout=subprocess.PIPE, text=True)
        assert rest.stdout
        said += _shown(rest.stdout)
        codes = [rest.wait()]
        for part, file in parts:
            codes.append(part.wait())
            file.seek(0)
            said += _shown(file)
    print(*(line for line in said if line.startswith(_FAILED)), sep="", end="")
    print(f"{_sum(said)} in {time.monotonic() - began:.2f}s")
    return next((code for code in codes if code), 0)


def _shown(lines: Iterable[str]) -> Iterable[str]:
    for line in lines:
        print(line, end="", flush=True)
        yield line


def _sum(said: Iterable[str]) -> str:
    """Of the last lines of all parts: `7279 passed in 194.36s (0:03:14)`."""
    counts: Counter[str] = Counter()
    for line in said:
        if _SUMMARY.fullmatch(line):
            counts.update({name: int(number) for number, name in re.findall(r"(\d+) ([a-z]+)", line)})
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def _pytest() -> list[str]:
    return [sys.executable, "-m", "pytest"]


if __name__ == "__main__":
    sys.exit(main())
