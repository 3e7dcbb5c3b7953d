"""Signals that end a recording, or ask something of it, between two records."""

import signal
from types import FrameType
from typing import Self


class Ending:
    """Ctrl-C and SIGTERM, which end a recording between two records: what is half written would not be read.

    check() raises what the signal stands for, KeyboardInterrupt or SystemExit; so does leaving it. SIGUSR1 is an
    operator who wants something kept.
    """

    def __init__(self) -> None:
        self._number = 0
        self._is_asked = False
        self._before = {one: signal.signal(one, self._note) for one in (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1)}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if kind is None:
            self.check()

    def check(self) -> None:
        if self._number == signal.SIGINT:
            raise KeyboardInterrupt
        if self._number:
            raise SystemExit(0)

    def is_asked(self) -> bool:
        """Whether an operator has asked since the last time."""
        is_asked, self._is_asked = self._is_asked, False
        return is_asked

    def _note(self, number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGUSR1:
            self._is_asked = True
        else:
            self._number = number
