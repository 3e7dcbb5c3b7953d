"""Watchdog: detects calls of the vendor's library that do not return, inside its process."""

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, get_ident

CHECK_S = 1.0

# If the watchdog thread has not run for this time, the library blocks the whole Python interpreter. The kernel then
# ends the process by SIGALRM, which is not caught.
ALARM_S = 15.0


class Watch:
    """Watchdog of library calls, with a time limit for each.

    overdue  called once, in the watchdog's thread, with a text that names the call that has not returned.
    beat     called in the watchdog's thread at each check.
    check_s  interval of the checks in seconds.
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
        """Watch the body of a `with` statement: a call of this thread, named by `what`, that may take limit_s."""
        me = get_ident()
        self._calls[me] = what, limit_s, time.monotonic()
        try:
            yield
        finally:
            del self._calls[me]

    def run(self) -> None:
        """Check the calls in progress until stop(), or until one is overdue."""
        while not self._stopping.wait(self._check_s):
            signal.setitimer(signal.ITIMER_REAL, ALARM_S)
            self._beat()
            now = time.monotonic()
            for what, limit_s, began in tuple(self._calls.values()):
                if now - began > limit_s:
                    self._overdue(f"{what} has not returned for {limit_s:g} s")
                    return

    def stop(self) -> None:
        """Stop the checks and the kernel's alarm timer."""
        self._stopping.set()
        signal.setitimer(signal.ITIMER_REAL, 0.0)
