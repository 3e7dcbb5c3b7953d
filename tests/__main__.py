"""python -m tests: all tests, in three parts side by side; with words, pytest's own."""

import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

HERE = Path(__file__).parent
# Two parts of three, which take about as long: the first computes, the second and what is in neither wait for processes
# and sockets.
BESIDE = (
    (
        "tests/asn1", "tests/board", "tests/drivers/wire", "tests/firmware/box", "tests/firmware/codec",
        "tests/firmware/console", "tests/gateway", "tests/image", "tests/meter", "tests/pps",
    ),
    ("tests/system",),
)  # fmt: skip

_COUNTS = re.compile(r"(\d+) (passed|failed|errors?|skipped|xfailed|xpassed|deselected|warnings?)\b")


def main() -> int:
    """The exit code of the first part that went wrong, else 0. The last line is the sum of all."""
    if sys.argv[1:]:
        return subprocess.call([*_pytest(), *sys.argv[1:]], cwd=HERE.parent)
    began = time.monotonic()
    with ExitStack() as opened:
        said = [opened.enter_context(tempfile.TemporaryFile("w+")) for _ in BESIDE]
        parts = [
            subprocess.Popen([*_pytest(), *folders], cwd=HERE.parent, stdout=file, stderr=subprocess.STDOUT)
            for folders, file in zip(BESIDE, said, strict=True)
        ]
        rest = subprocess.Popen(
            [*_pytest(), *(f"--ignore={folder}" for folders in BESIDE for folder in folders)],
            cwd=HERE.parent,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert rest.stdout
        last = ""
        for line in rest.stdout:
            print(line, end="", flush=True)
            last = line
        codes = [rest.wait()]
        summaries = [last]
        for part, file in zip(parts, said, strict=True):
            codes.append(part.wait())
            file.seek(0)
            text = file.read()
            print(text, end="")
            summaries.append(text.rstrip().rpartition("\n")[2])
    counts: Counter[str] = Counter()
    for summary in summaries:
        counts.update({name: int(number) for number, name in _COUNTS.findall(summary)})
    print(f"{', '.join(f'{count} {name}' for name, count in counts.items())} in {time.monotonic() - began:.2f}s")
    return next((code for code in codes if code), 0)


def _pytest() -> list[str]:
    return [sys.executable, "-m", "pytest"]


if __name__ == "__main__":
    sys.exit(main())
