"""Copies of `captain v2n-tap` as processes, and messages whose loss or doubling would be seen."""

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Self

from tests.broker.client import Client

ROOT = Path(__file__).parents[3]
PATIENCE = 20.0  # s; reached only by a test that fails
_changed = threading.Condition()  # of the lines of all copies
TOPIC = "v2x/cam"  # of profile raw


def numbered(number: int) -> bytes:
    """A CAM, as far as its header goes, with a number in it."""
    return bytes((2, 2)) + (1337).to_bytes(4) + number.to_bytes(4)


def number_of(record: dict[str, object]) -> int:
    return int(str(record["hex"])[12:], 16)


class Copy:
    """One copy; ready when this returns. lines: what it printed, read by a thread of its own."""

    def __init__(self, *options: str) -> None:
        self.lines: list[str] = []
        self._process = subprocess.Popen(
            [sys.executable, "-m", "firmware", "v2n-tap", *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=ROOT,
        )
        assert self._process.stderr is not None
        first = self._process.stderr.readline()
        assert "subscribed" in first, first + self._process.stderr.read()
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with _changed:
                self.lines.append(line)
                _changed.notify_all()

    @property
    def numbers(self) -> list[int]:
        with _changed:
            return [number_of(json.loads(line)) for line in self.lines]

    def wait_for(self, count: int) -> None:
        """Until it has printed so many lines."""
        wait_for([self], count)

    def end(self, number: int = signal.SIGTERM) -> tuple[int, str]:
        """Ask it to end. Returns its exit status and what it said."""
        self._process.send_signal(number)
        return self.result()

    def result(self) -> tuple[int, str]:
        """Wait for its end."""
        assert self._process.stderr is not None
        said = self._process.stderr.read()
        code = self._process.wait(PATIENCE)
        self._thread.join(PATIENCE)
        return code, said

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        self._thread.join(PATIENCE)
        for stream in (self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()


def wait_for(copies: Sequence[Copy], count: int) -> None:
    """Until together they have printed so many lines."""

    def printed() -> int:
        return sum(len(copy.lines) for copy in copies)

    with _changed:
        assert _changed.wait_for(lambda: printed() >= count, PATIENCE), f"{printed()} of {count}"


def publish(client: Client, first: int, count: int) -> None:
    """Messages with numbers from first on, QoS 1; returns when the broker has them all."""
    for number in range(first, first + count):
        client.publish(TOPIC, numbered(number), qos=1)
