"""python -m tests: all tests, in two halves side by side; with words, pytest's own."""

import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

HERE = Path(__file__).parent
# One half, most of which computes; most of the other waits for processes and sockets. Both take about as long.
BESIDE = (
    "tests/asn1", "tests/board", "tests/drivers/wire", "tests/firmware/box", "tests/firmware/codec",
    "tests/firmware/console", "tests/gateway", "tests/image", "tests/meter", "tests/pps",
)  # fmt: skip

_COUNTS = re.compile(r"(\d+) (passed|failed|errors?|skipped|xfailed|xpassed|deselected|warnings?)\b")


def main() -> int:
    """The exit code of the half that went wrong, else 0. The last line is the sum of both."""
    if sys.argv[1:]:
        return subprocess.call([*_pytest(), *sys.argv[1:]], cwd=HERE.parent)
    began = time.monotonic()
    with tempfile.TemporaryFile("w+") as beside:
        first = subprocess.Popen([*_pytest(), *BESIDE], cwd=HERE.parent, stdout=beside, stderr=subprocess.STDOUT)
        second = subprocess.Popen(
            [*_pytest(), *(f"--ignore={folder}" for folder in BESIDE)],
            cwd=HERE.parent,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert second.stdout
        last = ""
        for line in second.stdout:
            print(line, end="", flush=True)
            last = line
        codes = second.wait(), first.wait()
        beside.seek(0)
        text = beside.read()
    print(text, end="")
    counts: Counter[str] = Counter()
    for summary in (last, text.rstrip().rpartition("\n")[2]):
        counts.update({name: int(number) for number, name in _COUNTS.findall(summary)})
    print(f"{', '.join(f'{count} {name}' for name, count in counts.items())} in {time.monotonic() - began:.2f}s")
    return next((code for code in codes if code), 0)


def _pytest() -> list[str]:
    return [sys.executable, "-m", "pytest"]


if __name__ == "__main__":
    sys.exit(main())
