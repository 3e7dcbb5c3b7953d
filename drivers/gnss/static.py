"""Surveyed position in place of a receiver, for example of a roadside unit; reports no time."""

from board.machine import Machine
from board.runtime.errors import RequestError
from board.runtime.loop import Timer
from board.time.scales import Fix, FixKind
from drivers.gnss.options import GnssOptions
from drivers.gnss.receiver import ReceiverHost

PERIOD_S = 1.0


class StaticReceiver:
    """Reports the surveyed position of the options every second."""

    def __init__(self, options: GnssOptions, machine: Machine, above: ReceiverHost) -> None:
        latitude, longitude = options.surveyed()
        self._above = above
        self._timer: Timer | None = None
        accuracy_mm = round(options.accuracy_m * 1000)
        has_altitude = options.altitude_m is not None
        self._fix = Fix(
            0.0,
            FixKind.FULL if has_altitude else FixKind.FLAT,
            latitude=round(latitude * 10**7),
            longitude=round(longitude * 10**7),
            altitude=round((options.altitude_m or 0.0) * 1000) if has_altitude else None,
            horizontal=accuracy_mm,
            vertical=accuracy_mm if has_altitude else None,
            speed=0,
        )

    def start(self) -> None:
        self._above.configured("a position that was surveyed")
        self._timer = self._above.host.loop.after(0.0, self._tell)

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def silent(self, seconds: float) -> None:
        """Do nothing: a surveyed position is never silent."""

    def correct(self, frame: bytes) -> None:
        """Ignore the frame: a surveyed position needs no corrections."""

    def reset(self, kind: str) -> None:
        """Refuse a reset. Always raises RequestError, because no receiver exists."""
        raise RequestError("a static position cannot be reset", "it is in captain.toml")

    def details(self) -> dict[str, object]:
        return {}

    def _tell(self) -> None:
        loop = self._above.host.loop
        self._timer = loop.after(PERIOD_S, self._tell)
        self._above.epoch(self._fix._replace(monotonic=loop.clock()))
