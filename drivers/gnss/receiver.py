"""Contract between a kind of receiver and its supervision: calls and reports."""

from typing import Protocol

from board.runtime.errors import InterfaceError
from board.time.scales import Fix, TimeMark
from drivers.contract import Host

SILENT_S = 3.0  # seconds without an epoch after which the link is down


class ReceiverHost(Protocol):
    """Reports of a receiver after its start."""

    host: Host

    def configured(self, why: str) -> None:
        """Report that the receiver was found and brought up; the link comes up with the first epoch.

        why  text of the link in status.
        """

    def epoch(self, fix: Fix) -> None:
        """Report the solution of one epoch, with or without a position."""

    def time_mark(self, mark: TimeMark) -> None:
        """Report the time mark of the next pulse."""

    def failed(self, error: InterfaceError) -> None:
        """Report a fault after which the receiver cannot continue."""


class Receiver(Protocol):
    """One kind of receiver, from start to stop of its interface; each start creates a new one."""

    def start(self) -> None:
        """Open the receiver. Raises InterfaceError if its port cannot be opened; stop() then closes everything."""

    def stop(self) -> None:
        """Close the receiver; idempotent."""

    def silent(self, seconds: float) -> None:
        """React to missing epochs; called once a second while none has arrived for SILENT_S or longer."""

    def correct(self, frame: bytes) -> None:
        """Send an RTCM frame with corrections to the receiver."""

    def reset(self, kind: str) -> None:
        """Reset the receiver: hot, warm, cold, or full. Raises RequestError if it cannot be reset."""

    def details(self) -> dict[str, object]:
        """Return details of the receiver for status."""
