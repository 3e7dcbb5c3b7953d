"""Signals as a Source: the handler only wakes the loop."""

import signal
import socket
from collections.abc import Callable, Mapping

from board.runtime.loop import Loop


class Signals:
    """Calls on the loop for each signal of a table. A repeated signal is not lost while the first is unread.

    calls  by signal number, the function to call.
    """

    def __init__(self, loop: Loop, calls: Mapping[int, Callable[[], None]]) -> None:
        self._loop = loop
        self._calls = dict(calls)
        self._read, self._write = socket.socketpair()
        self._read.setblocking(False)
        self._write.setblocking(False)
        # The descriptor is set first, because a signal between these two lines would otherwise be lost.
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
        """Restore the previous signal handlers."""
        self._loop.remove(self)
        signal.set_wakeup_fd(self._wakeup)
        for number, before in self._before.items():
            signal.signal(number, before)
        self._read.close()
        self._write.close()
