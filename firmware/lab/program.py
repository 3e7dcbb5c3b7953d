"""Another process of the same program: started, ready, stopped by its id, and never left behind."""

import contextlib
import os
import selectors
import signal
import socket
import subprocess
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import firmware
from board.child import die_with_parent, program
from board.errors import StationError

READY_S = 30.0  # a station is ready after 0.2 s; a machine that swaps or is emulated takes longer
STOP_S = 3.0  # a station drains within 1 s
LAST_LINES = 20


class Program:
    """A process with a session of its own, so that a terminal's Ctrl-C reaches only its parent.

    name         that it has in messages.
    arguments    of the command line.
    given        what it reads from standard input.
    environment  that it gets beside ours.
    """

    def __init__(
        self, name: str, arguments: Sequence[str], given: bytes = b"", environment: Mapping[str, str] | None = None
    ) -> None:
        self.name = name
        self._lines: deque[str] = deque(maxlen=LAST_LINES)
        self._notices = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._notices.bind("")  # an abstract address that the kernel chooses (unix(7)): no file is left behind
        path = os.pathsep.join(filter(None, (str(Path(firmware.__file__).parents[1]), os.environ.get("PYTHONPATH"))))
        address = "@" + os.fsdecode(self._notices.getsockname()[1:])
        self._process = subprocess.Popen(
            [*program(), *arguments],
            env={**os.environ, **(environment or {}), "PYTHONPATH": path, "NOTIFY_SOCKET": address},
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
            preexec_fn=_die_with(os.getpid()),  # noqa: PLW1509 (no thread of ours holds a lock)
        )
        assert self._process.stdin is not None
        assert self._process.stderr is not None
        self._said = self._process.stderr
        os.set_blocking(self._said.fileno(), False)
        with contextlib.suppress(BrokenPipeError), self._process.stdin as standard_input:
            standard_input.write(given)

    @property
    def pid(self) -> int:
        return self._process.pid

    def fileno(self) -> int:
        """Readable when it has said something, or has ended: then check() tells."""
        return self._said.fileno()

    def wait_until_ready(self, timeout: float = READY_S) -> None:
        """Wait for READY=1 of sd_notify(3). Raises StationError with its last lines when it ends before."""
        deadline = time.monotonic() + timeout
        with selectors.DefaultSelector() as selector:
            selector.register(self._notices, selectors.EVENT_READ)
            selector.register(self._said, selectors.EVENT_READ)
            while (left := deadline - time.monotonic()) > 0:
                ready = {key.fileobj for key, _ in selector.select(left)}
                if self._notices in ready and b"READY=1" in self._notices.recv(4096).split(b"\n"):
                    return
                if self._said in ready:
                    self.check()
        raise StationError(f"{self.name} was not ready after {timeout:g} s: {self._last()}")

    def check(self) -> None:
        """Take what it said. Raises StationError when it has ended."""
        while True:
            part = self._said.read(1 << 16)
            if part is None:
                return
            if not part:
                break
            self._lines.extend(part.decode(errors="backslashreplace").splitlines())
        code = self._process.wait(STOP_S)
        raise StationError(f"{self.name} ended with {code}: {self._last()}")

    def stop(self) -> None:
        """End it, with force if it does not listen; idempotent."""
        end(self._process)
        self._said.close()
        self._notices.close()

    def _last(self) -> str:
        return "\n  ".join(self._lines) or "it said nothing"


def end(process: "subprocess.Popen[bytes]") -> None:
    """End a child, with force if it does not listen; idempotent."""
    if process.poll() is not None:
        return
    process.terminate()
    try:
        process.wait(STOP_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _die_with(parent: int) -> Callable[[], None]:
    """What the child does before it becomes the program: ask for SIGTERM when its parent is gone."""

    die = die_with_parent(signal.SIGTERM)

    def ask() -> None:
        die()
        if os.getppid() != parent:
            os._exit(1)

    return ask
