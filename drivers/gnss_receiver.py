"""What the kinds of receiver have in common: how each is driven, and what it tells."""

from typing import Protocol

from board.errors import InterfaceError
from board.time import Fix, TimeMark
from drivers.contract import Host

SILENT_S = 3.0  # without an epoch; the link is down then


class Above(Protocol):
    """What a receiver tells, once it was started."""

    host: Host

    def configured(self, why: str) -> None:
        """It was found and brought up: epochs should follow, and the link is up with the first one."""

    def epoch(self, fix: Fix) -> None:
        """A solution, with a position or without."""

    def time_mark(self, mark: TimeMark) -> None:
        """What is said of the next pulse."""

    def failed(self, error: InterfaceError) -> None:
        """It does not go on."""


class Receiver(Protocol):
    """One kind of receiver. start() may come again after stop()."""

    def start(self) -> None:
        """Open it. Raises InterfaceError, having closed what was open."""

    def stop(self) -> None:
        """Close it; idempotent."""

    def silent(self, seconds: float) -> None:
        """No epoch came for SILENT_S or longer; told once a second."""

    def correct(self, frame: bytes) -> None:
        """An RTCM frame for it."""

    def reset(self, kind: str) -> None:
        """Reset it: hot, warm, cold, or full. Raises RequestError where it cannot be."""

    def details(self) -> dict[str, object]:
        """What status shows of it."""
