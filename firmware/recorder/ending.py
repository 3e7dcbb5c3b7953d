"""Signals that end or trigger a recording, handled between two records."""

import signal
from types import FrameType
from typing import Self


class Ending:
    """Defers the end of a recording at Ctrl-C, SIGTERM or SIGHUP until the current record is complete.

    A half-written record would be unreadable. check() raises KeyboardInterrupt or SystemExit after such a signal; so
    does the end of the context. SIGUSR1 is the trigger of an operator.
    """

    def __init__(self) -> None:
        self._number = 0
        self._is_asked = False
        heard = [signal.SIGINT, signal.SIGTERM, signal.SIGUSR1]
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # nohup ignores SIGHUP, and this must remain so
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
        """Whether an operator has sent SIGUSR1 since the last call."""
        is_asked, self._is_asked = self._is_asked, False
        return is_asked

    def _note(self, number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGUSR1:
            self._is_asked = True
        else:
            self._number = number
