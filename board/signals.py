"""Signals as a source of the loop: the handler only wakes it, the work is done in a turn."""

import signal
import socket
from collections.abc import Callable, Mapping

from board.loop import Loop


class Signals:
    """Calls on the loop for each signal of a table; one of the same number that is still unread is not lost.

    calls  signal number -> what to do.
    """

    def __init__(self, loop: Loop, calls: Mapping[int, Callable[[], None]]) -> None:
        self._loop = loop
        self._calls = dict(calls)
        self._read, self._write = socket.socketpair()
        self._read.setblocking(False)
        self._write.setblocking(False)
        # The descriptor first: a signal that comes between the two lines must not be swallowed.
        self._wakeup = signal.set_wakeup_fd(self._write.fileno(), warn_on_full_buffer=False)
        self._before = {number: signal.signal(number, lambda *_: None) for number in self._calls}
        loop.add(self)

    def fileno(self) -> int:
        return self._read.fileno()

    def ready(self, events: int) -> None:
        for number in self._read.recv(64):
            call = self._calls.get(number)
            if call is not None:
                call()

    def close(self) -> None:
        """Give the signals back to whom they belonged."""
        self._loop.remove(self)
        signal.set_wakeup_fd(self._wakeup)
        for number, before in self._before.items():
            signal.signal(number, before)
        self._read.close()
        self._write.close()
