"""A program on a pty of its own as its controlling terminal, driven like expect: type, and wait for what is shown."""

import fcntl
import os
import re
import select
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable
from pathlib import Path

import pyte

ROOT = Path(__file__).parents[3]
PATIENCE_S = 20.0  # reached only by a test that fails


class Expect:
    """`captain console` with a VT100 of 80 columns and 24 lines in front of it.

    is_controlling  whether the pty is the controlling terminal of its session.
    """

    def __init__(self, *options: str, runtime: Path, is_controlling: bool = True, term: str = "vt100") -> None:
        self.sent = b""
        self.screen = pyte.Screen(80, 24)
        self._stream = pyte.ByteStream(self.screen)
        self.master, slave = os.openpty()
        fcntl.ioctl(self.master, termios.TIOCSWINSZ, struct.pack("4H", 24, 80, 0, 0))
        self.modes = termios.tcgetattr(slave)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "firmware", "console", *options],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            cwd=ROOT,
            env={**os.environ, "TERM": term, "PS1": "prompt> ", "XDG_RUNTIME_DIR": str(runtime)},
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

    def prompted(self) -> None:
        """Until the shell waits for a command: what is typed before would be shown wherever it falls."""
        self._until(lambda: self.text.rstrip().endswith("prompt>"), "a prompt is shown")

    def run(self, command: str, answer: str) -> re.Match[str]:
        """Give a command to the shell, and wait for a line that is an answer as a regular expression has it."""
        self.prompted()
        self.type(f"{command}\n".encode())
        line = re.compile(rf"^{answer}$", re.MULTILINE)
        self._until(lambda: line.search(self.text) is not None, f"{answer!r} is answered")
        found = line.search(self.text)
        assert found
        return found

    def until_gone(self, words: str) -> None:
        self._until(lambda: words not in self.text, f"{words!r} is gone")

    def ended(self) -> int:
        """Exit status, once it has ended by itself."""
        return self.process.wait(PATIENCE_S)

    def hang_up(self) -> None:
        if self.master >= 0:
            os.close(self.master)
            self.master = -1

    def _until(self, is_so: Callable[[], bool], what: str) -> None:
        end = time.monotonic() + PATIENCE_S
        while not is_so():
            left = end - time.monotonic()
            assert left > 0, f"not {what}:\n{self.text}"
            if select.select([self.master], [], [], left)[0]:
                octets = os.read(self.master, 4096)
                self.sent += octets
                self._stream.feed(octets)
