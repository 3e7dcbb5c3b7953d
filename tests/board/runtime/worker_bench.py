"""Worker under test on a loop of its own, with programs for its child."""

import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from board.runtime import worker
from board.runtime.worker import Worker
from tests.virtual import VirtualLoop

PROGRAM = [sys.executable, "-P", str(Path(__file__).with_name("worker_program.py"))]
SLEEPER = [sys.executable, "-c", "import time; time.sleep(60)"]
STRANGER = [sys.executable, "-c", "import socket, sys; socket.socket(fileno=int(sys.argv[3])).send(b'what?')"]
MUTE = "import socket, sys; end = socket.socket(fileno=int(sys.argv[3])); end.send(b'hello'); end.recv(9); end.recv(9)"


class Bench:
    """A worker on a loop of its own, and what it told."""

    def __init__(self, name: str, command: list[str], silence_s: float = 0.0) -> None:
        # A child that works answers long before the patience is over: the clock stands unless a test moves it.
        self.loop = VirtualLoop(patience_s=20.0)
        self.messages: list[bytes] = []
        self.states: list[tuple[bool, str]] = []
        self.writable = 0
        self.on_message: Callable[[bytes], None] = self.messages.append
        self.worker = Worker(
            self.loop,
            name,
            on_message=self._note,
            on_state=lambda is_up, why: self.states.append((is_up, why)),
            on_writable=self._count,
            command=command,
            silence_s=silence_s,
        )

    def _note(self, message: bytes) -> None:
        self.on_message(message)  # which a test may have changed

    def _count(self) -> None:
        self.writable += 1

    def up(self) -> int:
        """Start, wait until it runs; returns its process id."""
        before = len(self.states)
        self.worker.start()
        self.loop.run_until(lambda: len(self.states) > before)
        is_up, why = self.states[-1]
        assert is_up, why
        return int(re.findall(r"process (\d+) runs", why)[0])

    def down(self) -> str:
        """Wait until it has ended; returns why."""
        self.loop.run_until(lambda: not self.states[-1][0])
        return self.states[-1][1]

    def pass_time(self, seconds: float) -> None:
        self.loop.now += seconds
        self.loop.turn()

    def receive(self, count: int) -> list[bytes]:
        self.loop.run_until(lambda: len(self.messages) >= count)
        return self.messages


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Bench]]:
    monkeypatch.setattr(worker, "jitter", lambda: 1.0)
    made: list[Bench] = []

    def bench(name: str, command: list[str] = PROGRAM, silence_s: float = 0.0) -> Bench:
        made.append(Bench(name, command, silence_s))
        return made[-1]

    yield bench
    for each in made:
        each.worker.finish(within=0.0)
        each.loop.close()


def is_gone(pid: int) -> bool:
    """Ended, and no zombie of ours."""
    return not Path(f"/proc/{pid}").exists()
