"""Quality of the system clock: from chronyd if configured, else from the kernel."""

import logging
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from board.runtime.errors import InterfaceError
from board.runtime.journal import Journal
from board.runtime.loop import Loop
from board.time.scales import EPOCH, Lock, TimeQuality
from pps.kernel_clock import kernel_clock

if TYPE_CHECKING:
    from pps.chrony.tracking import Tracker, Tracking

LATEST_S = 1.0  # largest age of an answer of chronyd when it is first seen here
DRIFT_PPM = 15  # growth of the error bound with the age of the answer: RFC 5905, PHI

log = logging.getLogger("captain.time")


class SystemClock:
    """Quality of the system clock.

    Its offset is reported as 0, because chronyd or the kernel is already correcting it. The known error is part of the
    error bound instead (chronyc(1): clock_error <= |offset| + root_dispersion + root_delay / 2).

    is_asked  True asks chronyd; False uses the kernel's error bound.
    is_set    returns True if the clock was set since boot. Otherwise its quality is unknown.
    """

    def __init__(self, loop: Loop, is_asked: bool, is_set: Callable[[], bool] = lambda: True) -> None:
        self._loop = loop
        self._is_set = is_set
        self._tracker = self._made() if is_asked else None
        self._said: Tracking | None = None
        self._said_at = 0.0

    def start(self) -> None:
        if self._tracker is not None:
            self._tracker.start()

    def stop(self) -> None:
        """Stop asking chronyd; a second call has no effect."""
        if self._tracker is not None:
            self._tracker.stop()

    def chronyds_ns(self) -> int | None:
        """Return chronyd's current error bound in ns; None without an answer, or if the clock is not set."""
        latest = self._tracker.latest if self._tracker else None
        now = self._loop.clock()
        if latest is not self._said:
            self._said, self._said_at = latest, now - LATEST_S
        if latest is None or latest.offset_ns is None or latest.uncertainty_ns is None or time.time() < EPOCH:
            return None
        return abs(latest.offset_ns) + latest.uncertainty_ns + round((now - self._said_at) * 1000 * DRIFT_PPM)

    def quality(self) -> TimeQuality:
        """Return the current quality: error bound of chronyd or the kernel; unknown if the clock is not set."""
        if time.time() < EPOCH or not self._is_set():
            return TimeQuality()
        error_ns = self.chronyds_ns()
        if error_ns is None:
            error_ns = _kernels_ns()
        return TimeQuality(Lock.SYSTEM) if error_ns is None else TimeQuality(Lock.SYSTEM, 0, error_ns)

    def status(self) -> dict[str, object] | None:
        """Return the last answer of chronyd, with the fields of Tracking; None if chronyd is not asked.

        why  reason why chronyd does not answer; empty if it does.
        """
        tracker = self._tracker
        if tracker is None:
            return None
        return {"why": tracker.why, **(tracker.latest._asdict() if tracker.latest else {})}

    def _made(self) -> "Tracker":
        # Imported on demand, because it loads the code for child processes, and few stations ask chronyd.
        from pps.chrony.tracking import Tracker

        return Tracker(self._loop, Journal(log, "chrony", self._loop.clock))


def _kernels_ns() -> int | None:
    try:
        return kernel_clock().uncertainty_ns
    except InterfaceError:
        return None
