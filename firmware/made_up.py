"""Whether the clock of this machine was ever set: without a battery it begins with a date that nobody vouches for."""

import time
from collections.abc import Callable
from pathlib import Path

from board.errors import InterfaceError
from board.time import EPOCH, ITS_END
from pps.kernel_clock import kernel_clock

# The early boot of the image writes it where it has made the time up, of the build's date or of the last one that was
# kept. Elsewhere a machine's battery, or whoever started it, is believed.
MARK = Path("/run/early.clock")


def _is_steered() -> bool:
    """Whether somebody has told the kernel that the clock is right: chronyd with rtcsync, or another one."""
    try:
        return kernel_clock().is_synchronised
    except InterfaceError:
        return False


class ClockSet:
    """Whether it is set, as long as a program runs: once it was, it stays so.

    mark        is there where the time was made up.
    is_steered  whether the clock is steered by now.
    """

    def __init__(self, mark: Path = MARK, is_steered: Callable[[], bool] = _is_steered) -> None:
        self._is_made_up = mark.exists()
        self._is_steered = is_steered

    def __call__(self) -> bool:
        if self._is_made_up and self._is_steered():
            self._is_made_up = False
        return not self._is_made_up and EPOCH <= time.time() < ITS_END


def is_clock_set() -> bool:
    """Of now, for a program that asks once."""
    return ClockSet()()
