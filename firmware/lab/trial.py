"""Starts a driver for a moment and stops it again, to see whether it could run and what it says if not."""

from collections.abc import Mapping

from board.errors import StationError
from board.loop import Loop
from board.time import Fix, TimeMark
from drivers.contract import Driver
from drivers.message import NO_RX_INFO, Ego, Position, Request, RxInfo
from drivers.reason import Reason


class Trial:
    """A host that asks for nothing but the link; what is received meanwhile is let go."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.slot = ""
        self.loop = Loop()
        self.is_up = False
        self.why = "it has not said whether its link is up"
        self.failure: StationError | None = None

    def run(self, driver: Driver) -> None:
        """Start and stop. Raises StationError, the driver's own, when it cannot start."""
        try:
            driver.start(self)
        finally:
            driver.stop()
            self.loop.close()
        if self.failure is not None:
            raise self.failure

    def link(self, is_up: bool, why: str) -> None:
        self.is_up, self.why = is_up, why

    def fail(self, error: StationError) -> None:
        self.failure = error

    def ego(self) -> Ego:
        return Ego(0, Position(), False)

    def indicate(self, pdu: bytes, received_ns: int, rx: RxInfo = NO_RX_INFO) -> None: ...
    def heard(self, mac: bytes, rssi_dbm: int | None) -> None: ...
    def drop(self, reason: Reason, sample: bytes = b"", count: int = 1, detail: str = "") -> None: ...
    def confirm(self, request: Request, reason: Reason | None = None, detail: str = "") -> None: ...
    def writable(self) -> None: ...
    def fix(self, fix: Fix) -> None: ...
    def time_mark(self, mark: TimeMark) -> None: ...
    def tell(self, details: Mapping[str, object]) -> None: ...
