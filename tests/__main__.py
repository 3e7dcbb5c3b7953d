"""Test runner: runs all tests in parallel parts, or pytest with given arguments."""

import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path

from board.runtime.child import die_with_parent

HERE = Path(__file__).parent
# Folders of each part; one more part has all other folders. The parts take about the same time: the first one computes,
# the others wait for processes and sockets.
PARTS = (
    (
        "tests/asn1", "tests/board", "tests/drivers/wire", "tests/firmware/card", "tests/firmware/update", "tests/firmware/codec",
        "tests/firmware/console", "tests/firmware/gateway", "tests/image", "tests/firmware/meter", "tests/pps",
        "tests/firmware/captain_client",
    ),
    ("tests/system",),
)  # fmt: skip

_SUMMARY = re.compile(r"(?:\d+ [a-z]+, )*\d+ [a-z]+ in [\d.]+s(?: \(\d+:\d\d:\d\d\))?\s*")
ENDS = (0, 1)  # exit codes of pytest after a complete run: all tests passed, or some failed


def main() -> int:
    """Run the tests and print the sums of all parts. Return the exit code of the first part that failed, else 0."""
    if sys.argv[1:]:
        return subprocess.call([*_pytest(), *sys.argv[1:]], cwd=HERE.parent)
    began = time.monotonic()
    with ExitStack() as opened:
        parts = [opened.enter_context(_Part(folders)) for folders in PARTS]
        parts.insert(0, opened.enter_context(_Part(f"--ignore={folder}" for folders in PARTS for folder in folders)))
        try:
            for part in parts:
                part.show()
        except KeyboardInterrupt:
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parts have received this signal as well
            print("stopped")
            return 130
    counts: Counter[str] = Counter()
    for part in parts:
        print(*part.failures, sep="", end="")
        counts.update(part.counts)
        if part.code not in ENDS:
            print(f"{' '.join(part.words)}: pytest has ended with {part.code}")
    print(f"{', '.join(f'{count} {name}' for name, count in counts.items())} in {time.monotonic() - began:.2f}s")
    return next((part.code for part in parts if part.code), 0)


class _Part:
    """Part of the tests, in a pytest process that runs until the `with` block ends.

    words     arguments of pytest.

    The following are known after show():

    code      exit code of pytest.
    failures  lines of failed tests in pytest's short summary.
    counts    number of tests by outcome, from pytest's last line.
    """

    def __init__(self, words: Iterable[str]) -> None:
        self.words = list(words)
        self.code = 0
        self.failures: list[str] = []
        self.counts: dict[str, int] = {}

    def __enter__(self) -> "_Part":
        self._file = tempfile.NamedTemporaryFile()  # not a pipe: a full pipe without a reader would block pytest
        command = [*_pytest(), *self.words]
        self._process = subprocess.Popen(
            command,
            cwd=HERE.parent,
            stdout=self._file,
            stderr=subprocess.STDOUT,
            preexec_fn=die_with_parent(signal.SIGTERM),  # noqa: PLW1509 - no other thread runs here
        )
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.terminate()
            self._process.wait()
        self._file.close()

    def show(self) -> None:
        """Print the output of pytest as it appears, until pytest has ended."""
        is_summary = False
        last = ""
        for line in self._lines():
            print(line, end="", flush=True)
            is_summary = is_summary or "short test summary info" in line
            if is_summary and line.startswith(("FAILED ", "ERROR ")):
                self.failures.append(line)
            last = line
        self.code = self._process.wait()
        if _SUMMARY.fullmatch(last):
            self.counts = {name: int(number) for number, name in re.findall(r"(\d+) ([a-z]+)", last)}

    def _lines(self) -> Iterator[str]:
        begun = ""
        with open(self._file.name, encoding="utf-8", errors="replace") as said:
            while True:
                has_ended = self._process.poll() is not None
                for line in said:
                    begun += line
                    if begun.endswith("\n"):
                        yield begun
                        begun = ""
                if has_ended:
                    if begun:
                        yield begun
                    return
                time.sleep(0.1)


def _pytest() -> list[str]:
    return [sys.executable, "-m", "pytest"]


if __name__ == "__main__":
    sys.exit(main())
