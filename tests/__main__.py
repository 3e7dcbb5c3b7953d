"""python -m tests: all tests, in parts side by side; with words, pytest's own."""

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

from board.child import die_with_parent

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
ENDS = (0, 1)  # all passed; some failed


def main() -> int:
    """The exit code of the first part that went wrong, else 0. The last line is the sum of all."""
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
            signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parts have it as well
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
    """Tests that run in a process of their own until the block ends.

    words     of pytest's command line.
    failures  lines of its short summary; counts, of its last line: known once it has been shown, as its code.
    """

    def __init__(self, words: Iterable[str]) -> None:
        self.words = list(words)
        self.code = 0
        self.failures: list[str] = []
        self.counts: dict[str, int] = {}

    def __enter__(self) -> "_Part":
        self._file = tempfile.NamedTemporaryFile()  # a pipe that nobody reads would hold it up
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
        """All that it says, as it says it, until it has ended."""
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
