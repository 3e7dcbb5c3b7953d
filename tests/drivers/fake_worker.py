"""Fake worker: the test takes the place of the driver's process."""

from collections.abc import Callable
from typing import ClassVar


class FakeWorker:
    """Replacement of board.runtime.worker.Worker without a process.

    starts  False simulates that no process can be started.
    """

    made: ClassVar[list["FakeWorker"]] = []
    starts: ClassVar[bool] = True

    def __init__(
        self,
        loop: object,
        name: str,
        on_message: Callable[[bytes], None],
        on_state: Callable[[bool, str], None],
        on_writable: Callable[[], None],
        *,
        command: object,
        silence_s: float,
    ) -> None:
        self.message, self.state, self.writable = on_message, on_state, on_writable
        self.waited_s = 0.0
        self.is_up = self.is_stopped = self.is_full = False
        self.told: list[bytes] = []
        self.made.append(self)

    def start(self) -> None:
        if not FakeWorker.starts:
            self.state(False, "cannot be started: Too many open files; starts again in 0.2 s")

    def run(self) -> None:
        self.is_up = True
        self.state(True, "process 7 runs")

    def send(self, message: bytes) -> bool:
        if not self.is_up or self.is_full:
            return False
        self.told.append(message)
        return True

    def stop(self) -> None:
        self.is_stopped = True
        self.is_up = False

    def finish(self, within: float) -> None:
        self.waited_s = within

    def take(self, kind: int) -> list[bytes]:
        """Return the messages of one kind that the driver has sent since the last call."""
        found = [message for message in self.told if message[0] == kind]
        self.told = [message for message in self.told if message[0] != kind]
        return found
