"""Notices when a closed library does not return, in the process that runs it: nothing else there could."""

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, get_ident

CHECK_S = 1.0

# When nobody has looked for so long, the library keeps Python itself from running. The kernel then ends the process:
# SIGALRM is not caught.
ALARM_S = 15.0


class Watch:
    """Calls in progress, with the time that each may take.

    overdue  called from the watching thread with what has not returned, once.
    beat     called from there whenever it looks.
    """

    def __init__(self, overdue: Callable[[str], None], beat: Callable[[], None], check_s: float = CHECK_S) -> None:
        self._overdue = overdue
        self._beat = beat
        self._check_s = check_s
        self._calls: dict[int, tuple[str, float, float]] = {}
        self._stopping = Event()
        signal.setitimer(signal.ITIMER_REAL, ALARM_S)

    @contextmanager
    def call(self, what: str, limit_s: float) -> Iterator[None]:
        """Around a call of this thread that has to return within so many seconds."""
        me = get_ident()
        self._calls[me] = what, limit_s, time.monotonic()
        try:
            yield
        finally:
            del self._calls[me]

    def run(self) -> None:
        """Look until it is stopped, or something is overdue."""
        while not self._stopping.wait(self._check_s):
            signal.setitimer(signal.ITIMER_REAL, ALARM_S)
            self._beat()
            now = time.monotonic()
            for what, limit_s, began in tuple(self._calls.values()):
                if now - began > limit_s:
                    self._overdue(f"{what} has not returned for {limit_s:g} s")
                    return

    def stop(self) -> None:
        """Look no longer, and have the kernel forget it."""
        self._stopping.set()
        signal.setitimer(signal.ITIMER_REAL, 0.0)
