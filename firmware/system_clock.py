"""How good the system's clock is: by chronyd's word where that is asked, else by the kernel's."""

import logging
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from board.errors import InterfaceError
from board.journal import Journal
from board.loop import Loop
from board.time import EPOCH, Lock, TimeQuality
from pps.kernel_clock import kernel_clock

if TYPE_CHECKING:
    from pps.chrony_tracking import Tracker, Tracking

LATEST_S = 1.0  # after chronyd's answer it is seen
DRIFT_PPM = 15  # that a clock may be off by since somebody said how good it is: RFC 5905, PHI

log = logging.getLogger("captain.time")


class SystemClock:
    """Whoever steers it slews it to where it ought to be, at a pace of their own: it is stated to be right, and what it
    is known to be wrong by is in the bound (chronyc(1): clock_error <= |offset| + root_dispersion + root_delay / 2).

    is_asked  whether chronyd is asked. To be looked at once in LATEST_S.
    is_set    whether it was ever set: of one that was not nothing is known.
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
        """Idempotent."""
        if self._tracker is not None:
            self._tracker.stop()

    def chronyds_ns(self) -> int | None:
        """The most that it is wrong by now, as chronyd says; None where it says nothing, or the clock is not set."""
        latest = self._tracker.latest if self._tracker else None
        now = self._loop.clock()
        if latest is not self._said:
            self._said, self._said_at = latest, now - LATEST_S
        if latest is None or latest.offset_ns is None or latest.uncertainty_ns is None or time.time() < EPOCH:
            return None
        return abs(latest.offset_ns) + latest.uncertainty_ns + round((now - self._said_at) * 1000 * DRIFT_PPM)

    def quality(self) -> TimeQuality:
        """Of now, where nobody knows better."""
        if time.time() < EPOCH or not self._is_set():
            return TimeQuality()
        error_ns = self.chronyds_ns()
        if error_ns is None:
            error_ns = _kernels_ns()
        return TimeQuality(Lock.SYSTEM) if error_ns is None else TimeQuality(Lock.SYSTEM, 0, error_ns)

    def status(self) -> dict[str, object] | None:
        """What chronyd says; None where it is not asked."""
        tracker = self._tracker
        if tracker is None:
            return None
        return {"why": tracker.why, **(tracker.latest._asdict() if tracker.latest else {})}

    def _made(self) -> "Tracker":
        from pps.chrony_tracking import Tracker  # with what starts a child: most stations ask nobody

        return Tracker(self._loop, Journal(log, "chrony", self._loop.clock))


def _kernels_ns() -> int | None:
    try:
        return kernel_clock().uncertainty_ns
    except InterfaceError:
        return None
