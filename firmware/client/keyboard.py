"""Keyboard of a live table: reads single keys from the terminal without echo."""

import os
import re
import signal
import sys
import termios
from contextlib import suppress
from types import FrameType
from typing import Any

# Key sequences as ECMA-48 terminals send them: CSI or SS3 and one final octet; or one ASCII character.
KEY = re.compile(rb"\x1b[\[O][0-9;]{0,4}[@-~]|[\x00-\x7f]")
KEYS = {
    b"\x1b[A": "up",
    b"\x1bOA": "up",
    b"k": "up",
    b"\x1b[B": "down",
    b"\x1bOB": "down",
    b"j": "down",
    b"\x1b[5~": "page up",
    b"b": "page up",
    b"\x1b[6~": "page down",
    b" ": "page down",
    b"\x1b[H": "home",
    b"\x1bOH": "home",
    b"\x1b[1~": "home",
    b"g": "home",
    b"\x1b[F": "end",
    b"\x1bOF": "end",
    b"\x1b[4~": "end",
    b"G": "end",
    b"q": "quit",
}
LFLAG, CC = 3, 6  # indices into the list that termios.tcgetattr() returns
MOST = 256  # octets of one read at most


class Keyboard:
    """Keys from standard input, if it is a terminal and this process runs in its foreground; otherwise no keys.

    Ctrl-C and Ctrl-Z remain signals. A stopped process restores the terminal's modes, and changes them again when it
    continues.
    """

    def __init__(self) -> None:
        self._before: list[Any] | None = None
        self._signals: dict[signal.Signals, Any] = {}

    def __enter__(self) -> "Keyboard":
        with suppress(OSError, ValueError, termios.error):
            if self._is_foreground():
                self._before = termios.tcgetattr(self.fileno())
                self._take()
                self._signals = {
                    signal.SIGTSTP: signal.signal(signal.SIGTSTP, self._stop),
                    signal.SIGCONT: signal.signal(signal.SIGCONT, self._go_on),
                }
        return self

    def __exit__(self, *error: object) -> None:
        self._give_back()
        for number, before in self._signals.items():
            signal.signal(number, before)
        self._before = None

    @property
    def is_there(self) -> bool:
        return self._before is not None

    def fileno(self) -> int:
        return sys.stdin.fileno()

    def read(self) -> list[str] | None:
        """Return the known keys that were pressed; None when the terminal has hung up.

        In the background the keys are those of another program: to read them would stop this process (SIGTTIN).
        """
        try:
            if not self._is_foreground():
                return []
            octets = os.read(self.fileno(), MOST)
        except OSError:
            octets = b""
        return [KEYS[key] for key in KEY.findall(octets) if key in KEYS] if octets else None

    def _take(self) -> None:
        assert self._before is not None
        modes = list(self._before)
        modes[LFLAG] &= ~(termios.ICANON | termios.ECHO)
        modes[CC] = list(modes[CC])
        modes[CC][termios.VMIN], modes[CC][termios.VTIME] = 1, 0
        self._set(modes)

    def _give_back(self) -> None:
        with suppress(OSError):
            if self._before is not None and self._is_foreground():
                self._set(self._before)

    def _is_foreground(self) -> bool:
        """Whether the terminal's keys are this process's. Raises OSError without a terminal."""
        return os.tcgetpgrp(self.fileno()) == os.getpgrp()

    def _set(self, modes: list[Any]) -> None:
        with suppress(termios.error):  # the terminal may have hung up
            termios.tcsetattr(self.fileno(), termios.TCSADRAIN, modes)

    def _stop(self, _number: int, _frame: FrameType | None) -> None:
        self._give_back()
        os.kill(os.getpid(), signal.SIGSTOP)

    def _go_on(self, number: int, frame: FrameType | None) -> None:
        with suppress(OSError):
            if self._is_foreground():
                self._take()
        if callable(before := self._signals.get(signal.SIGCONT)):
            before(number, frame)
