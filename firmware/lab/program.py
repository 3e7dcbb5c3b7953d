"""Child process of this program: starts it, waits until it is ready, stops it."""

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
from board.runtime.child import die_with_parent, program
from board.runtime.errors import StationError

READY_S = 30.0  # a station is ready after 0.2 s; a machine that swaps or is emulated takes longer
STOP_S = 3.0  # seconds until a child is killed; a station drains within 1 s
LAST_LINES = 20


class Program:
    """Child process in a session of its own, so that Ctrl-C on a terminal reaches only its parent.

    name         name in messages.
    arguments    command line without the program.
    given        octets for its standard input.
    environment  additional environment variables.
    """

    def __init__(
        self, name: str, arguments: Sequence[str], given: bytes = b"", environment: Mapping[str, str] | None = None
    ) -> None:
        self.name = name
        self._lines: deque[str] = deque(maxlen=LAST_LINES)
        self._notices = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._notices.bind("")  # the kernel chooses an abstract address (unix(7)), which leaves no file behind
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
        """Return a descriptor that is readable when the process has written something or ended; call check() then."""
        return self._said.fileno()

    def wait_until_ready(self, timeout: float = READY_S) -> None:
        """Wait for READY=1 of sd_notify(3).

        Raises StationError with the last lines if the process ends before or takes too long.
        """
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
        """Read the lines that the process has written. Raises StationError if it has ended."""
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
        """Stop the process; kill it if it does not end within STOP_S. Repeated calls are harmless."""
        end(self._process)
        self._said.close()
        self._notices.close()

    def _last(self) -> str:
        return "\n  ".join(self._lines) or "it said nothing"


def end(process: "subprocess.Popen[bytes]") -> None:
    """Stop a child; kill it if it does not end within STOP_S. Repeated calls are harmless."""
    if process.poll() is not None:
        return
    process.terminate()
    try:
        process.wait(STOP_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _die_with(parent: int) -> Callable[[], None]:
    """Return a function that a child calls before it starts its program.

    It requests SIGTERM for the moment when the parent ends.
    """

    die = die_with_parent(signal.SIGTERM)

    def ask() -> None:
        die()
        if os.getppid() != parent:
            os._exit(1)

    return ask
