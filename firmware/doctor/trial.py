"""Trial of a driver: starts it for a moment and stops it."""

from collections.abc import Mapping

from board.runtime.errors import StationError
from board.runtime.loop import Loop
from board.time.scales import Fix, TimeMark
from drivers.contract import Driver
from drivers.message import NO_RX_INFO, Ego, Position, Request, RxInfo
from drivers.reason import Reason


class Trial:
    """Host of a driver on trial: notes the state of its link and ignores received messages."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.slot = ""
        self.loop = Loop()
        self.is_up = self.is_starting = False
        self.why = "it has not said whether its link is up"
        self.failure: StationError | None = None

    def run(self, driver: Driver) -> None:
        """Start and stop a driver. Raises the StationError with which the driver fails."""
        try:
            driver.start(self)
        finally:
            driver.stop()
            self.loop.close()
        if self.failure is not None:
            raise self.failure

    def link(self, is_up: bool, why: str) -> None:
        self.is_up, self.is_starting, self.why = is_up, False, why

    def starting(self, why: str) -> None:
        self.is_up, self.is_starting, self.why = False, True, why

    def fail(self, error: StationError) -> None:
        self.failure = error

    def ego(self) -> Ego:
        return Ego(0, Position(), False)

    def its_ms(self) -> int:
        return 0

    def indicate(self, pdu: bytes, received_ns: int, rx: RxInfo = NO_RX_INFO) -> None: ...
    def request(self, pdu: bytes, btp_port: int | None = None) -> None: ...
    def heard(self, mac: bytes, rssi_dbm: int | None) -> None: ...
    def drop(self, reason: Reason, sample: bytes = b"", count: int = 1, detail: str = "") -> None: ...
    def confirm(self, request: Request, reason: Reason | None = None, detail: str = "") -> None: ...
    def writable(self) -> None: ...
    def fix(self, fix: Fix) -> None: ...
    def time_mark(self, mark: TimeMark) -> None: ...
    def report_details(self, details: Mapping[str, object]) -> None: ...
