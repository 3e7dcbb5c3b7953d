"""Signals that end a recording, or ask something of it, between two records."""

import signal
from types import FrameType
from typing import Self


class Ending:
    """Ctrl-C, SIGTERM, and SIGHUP of a terminal that is gone: they end a recording between two records.

    What is half written would not be read.

    check() raises what the signal stands for, KeyboardInterrupt or SystemExit; so does leaving it. SIGUSR1 is an
    operator who wants something kept.
    """

    def __init__(self) -> None:
        self._number = 0
        self._is_asked = False
        heard = [signal.SIGINT, signal.SIGTERM, signal.SIGUSR1]
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup has it
            heard.append(signal.SIGHUP)
        self._before = {one: signal.signal(one, self._note) for one in heard}

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
