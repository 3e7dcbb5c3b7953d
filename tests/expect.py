"""Program on a pty of its own, driven like expect: types keys, waits for what is shown."""

import fcntl
import os
import re
import select
import struct
import subprocess
import termios
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pyte

ROOT = Path(__file__).resolve().parents[1]
PATIENCE_S = 20.0  # reached only by a test that fails


class Expect:
    """A program with a VT100 of 80 columns and 24 lines in front of it; it runs in the root of the repository.

    environment     variables in addition to this process's own.
    is_controlling  whether the pty is the controlling terminal of its session.
    """

    def __init__(self, command: Sequence[str], environment: Mapping[str, str], *, is_controlling: bool = True) -> None:
        self.sent = b""
        self.screen = pyte.Screen(80, 24)
        self._stream = pyte.ByteStream(self.screen)
        self.master, slave = os.openpty()
        fcntl.ioctl(self.master, termios.TIOCSWINSZ, struct.pack("4H", 24, 80, 0, 0))
        self.modes = termios.tcgetattr(slave)
        self.process = subprocess.Popen(
            command,
            stdin=slave,
            stdout=slave,
            stderr=slave,
            cwd=ROOT,
            env={**os.environ, **environment},
            start_new_session=True,
            preexec_fn=(lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0)) if is_controlling else None,  # noqa: PLW1509
        )
        self.slave = slave

    def __enter__(self) -> "Expect":
        return self

    def __exit__(self, *error: object) -> None:
        self.hang_up()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        os.close(self.slave)

    @property
    def text(self) -> str:
        return "\n".join(line.rstrip() for line in self.screen.display)

    def type(self, octets: bytes) -> None:
        assert os.write(self.master, octets) == len(octets)

    def until(self, words: str) -> None:
        self._until(lambda: words in self.text, f"{words!r} is shown")

    def until_line(self, pattern: str, patience_s: float = PATIENCE_S) -> re.Match[str]:
        """Wait for a line that a regular expression matches as a whole; return the match."""
        line = re.compile(rf"^{pattern}$", re.MULTILINE)
        self._until(lambda: line.search(self.text) is not None, f"{pattern!r} is answered", patience_s)
        found = line.search(self.text)
        assert found
        return found

    def prompted(self) -> None:
        """Until the shell waits for a command: what is typed before would be shown wherever it falls."""
        self._until(lambda: self.text.rstrip().endswith("prompt>"), "a prompt is shown")

    def run(self, command: str, answer: str) -> re.Match[str]:
        """Give a command to the shell, and wait for a line that is an answer as a regular expression has it."""
        self.prompted()
        self.type(f"{command}\n".encode())
        return self.until_line(answer)

    def until_gone(self, words: str) -> None:
        self._until(lambda: words not in self.text, f"{words!r} is gone")

    def ended(self) -> int:
        """Exit status, once it has ended by itself."""
        return self.process.wait(PATIENCE_S)

    def hang_up(self) -> None:
        if self.master >= 0:
            os.close(self.master)
            self.master = -1

    def _until(self, is_so: Callable[[], bool], what: str, patience_s: float = PATIENCE_S) -> None:
        end = time.monotonic() + patience_s
        while not is_so():
            left = end - time.monotonic()
            assert left > 0, f"not {what}:\n{self.text}"
            if select.select([self.master], [], [], left)[0]:
                octets = os.read(self.master, 4096)
                self.sent += octets
                self._stream.feed(octets)
