"""Has the clock been set since boot? Without an RTC it starts at a build-time default."""

import time
from collections.abc import Callable
from pathlib import Path

from board.runtime.errors import InterfaceError
from board.time.scales import EPOCH, ITS_END
from pps.kernel_clock import kernel_clock

# File that the image writes early at boot if it set the clock to a default: the build date, or the last saved time.
# Without this file, the clock counts as set.
MARK = Path("/run/early.clock")


def _is_steered() -> bool:
    """Return True if the kernel's clock is marked as synchronised. chronyd with `rtcsync` sets this mark."""
    try:
        return kernel_clock().is_synchronised
    except InterfaceError:
        return False


class ClockSet:
    """Callable that returns True if the system clock was set since boot. Once True, a loss of steering does not matter.

    mark        file that exists if the image set the clock to a default at boot.
    is_steered  returns True if a source of time steers the clock now.
    """

    def __init__(self, mark: Path = MARK, is_steered: Callable[[], bool] = _is_steered) -> None:
        self._is_default = mark.exists()
        self._is_steered = is_steered

    def __call__(self) -> bool:
        if self._is_default and self._is_steered():
            self._is_default = False
        return not self._is_default and EPOCH <= time.time() < ITS_END


def is_clock_set() -> bool:
    """Return True if the system clock was set since boot, for a program that needs this only once."""
    return ClockSet()()
