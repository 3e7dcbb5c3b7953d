"""Own position and time: the best fresh fix of a receiver, else the configured position."""

import math
from collections.abc import Callable
from typing import NamedTuple

from board.time.scales import Fix, FixKind, TimeMark
from drivers.message import Ego, Position
from firmware.clock.own_time import OwnTime
from firmware.config.tables import ConfiguredPosition

LOOK_S = 1.0  # time for which its_ms() reuses a reading of the own time
FRESH_S = 2.0  # age up to which a fix is used: receivers report at least once a second; a car moves 60 m in 2 s
# Millimetres. If the position is less certain, its position vector has no PAI: itsGnPaiInterval / 2, EN 302 636-4-1
# V1.4.1 Annex H.
MOST_UNCERTAIN = 40_000

POSITION_KINDS = frozenset({FixKind.DEAD_RECKONING, FixKind.FLAT, FixKind.FULL, FixKind.COMBINED})


class Fallback(NamedTuple):
    """Position that the station uses while no fix is fresh."""

    position: Position
    is_known: bool
    source: str


class OwnPosition:
    """Own position of the station: the best fresh fix, else a fallback. Fixes are used unchanged.

    Drivers have already removed jumps of their receivers from the fixes.

    configured    position until the first fix. While no fix is fresh, a stationary station keeps its configured
                  position or else its last one; the position of a mobile station is then unknown.
    is_mobile     station.is_mobile of captain.toml.
    is_clock_set  returns True if the system clock was set.
    """

    def __init__(
        self,
        clock: Callable[[], float],
        configured: ConfiguredPosition | None,
        is_mobile: bool,
        is_clock_set: Callable[[], bool] = lambda: True,
    ) -> None:
        self.time = OwnTime(clock, is_clock_set)
        self._clock = clock
        self._is_mobile = is_mobile
        is_configured = configured is not None
        self._fallback = Fallback(_position(configured), is_configured, "configured" if is_configured else "")
        self._fixes: dict[str, Fix] = {}
        self._source = ""
        self._best: Fix | None = None
        self._marks: dict[str, TimeMark] = {}
        self._marked = ""
        self._its_ms = 0
        self._looked_at = self._look_again = -math.inf

    def fix(self, source: str, fix: Fix) -> None:
        """Take a fix of a receiver. The fresh fix with the least uncertainty becomes the own position.

        source  interface of the receiver.
        """
        self.time.fix(fix)
        if not _is_usable(fix):
            return
        self._fixes[source] = fix
        fresh = {name: one for name, one in self._fixes.items() if self._is_fresh(one)}
        self._source = min(fresh, key=lambda name: _uncertainty(fresh[name]), default=source)
        self._best = self._fixes[self._source]
        if self._is_mobile:
            self._fallback = Fallback(_position_of(self._best), False, "")
        elif self._fallback.source != "configured":
            self._fallback = Fallback(_position_of(self._best), True, "last fix")

    def time_mark(self, source: str, mark: TimeMark) -> None:
        """Take a time mark, which announces the next pulse. source: interface of the receiver."""
        self.time.time_mark(mark)
        self._marks[source] = mark
        self._marked = source

    def fix_of(self, source: str) -> Fix | None:
        """Return the last usable fix of a receiver; None if it is not fresh."""
        found = self._fixes.get(source)
        return found if found is not None and self._is_fresh(found) else None

    def mark_of(self, source: str) -> TimeMark | None:
        """Return the last time mark of a receiver; None if it is not fresh."""
        found = self._marks.get(source)
        return found if found is not None and self._is_fresh(found) else None

    def ego(self) -> Ego:
        """Return own position and time, for position vectors.

        The time is that of the fix. If the time is unknown, the position is marked unknown as well, because a position
        vector needs a time. This is so in a box without a real-time clock before the first fix. The station still
        routes messages.
        """
        best = self._best
        if best is None or not self._is_fresh(best):
            its_ms = self.time.its_ms(self._clock())
            return Ego(its_ms or 0, self._fallback.position, self._fallback.is_known and its_ms is not None)
        its_ms = self.time.of_fix(best)
        if its_ms is None:
            return Ego(0, _position_of(best), False)
        speed, heading = round((best.speed or 0) / 10), round((best.heading or 0) / 10_000) % 3600
        return Ego(its_ms, _position_of(best), True, speed, heading, best.horizontal is not None)

    def its_ms(self) -> int:
        """Return the own ITS time in ms; 0 if unknown. For speed, it is read once per LOOK_S and extrapolated."""
        now = self._clock()
        if now >= self._look_again:
            self._looked_at, self._look_again = now, now + LOOK_S
            self._its_ms = self.time.its_ms(now) or 0
        return self._its_ms and self._its_ms + round((now - self._looked_at) * 1000)

    def status(self) -> dict[str, object]:
        """Return position and time mark.

        latitude      degrees, WGS84; null if unknown.
        longitude     degrees, WGS84; null if unknown.
        source        interface of the receiver; `configured` or `last fix` without a fresh fix; empty if unknown.
        age_s         seconds since the receiver's fix; absent without a fresh fix.
        time_mark     last time mark, the announcement of a pulse; null without a fresh one.
        """
        best = self._best
        if best is not None and self._is_fresh(best):
            said = _told(best) | {"source": self._source, "age_s": round(self._clock() - best.monotonic, 2)}
        else:
            latitude, longitude = self._fallback.position if self._fallback.is_known else (None, None)
            said = _degrees(latitude, longitude) | {"source": self._fallback.source}
        return said | {"time_mark": self._time_mark()}

    def _time_mark(self) -> dict[str, object] | None:
        """Return the last time mark, with the fields of TimeMark; None without a fresh one.

        source  interface of the receiver.
        age_s   seconds since the time mark was received.
        """
        mark = self.mark_of(self._marked)
        if mark is None:
            return None
        event = None if mark.leap_event is None else mark.leap_event._asdict()
        told = mark._asdict() | {"leap_event": event}
        return {"source": self._marked, "age_s": round(self._clock() - told.pop("monotonic"), 2), **told}

    def _is_fresh(self, said: Fix | TimeMark) -> bool:
        return self._clock() - said.monotonic <= FRESH_S


def _is_usable(fix: Fix) -> bool:
    is_placed = fix.kind in POSITION_KINDS and fix.latitude is not None and fix.longitude is not None
    return is_placed and (fix.horizontal is None or fix.horizontal <= MOST_UNCERTAIN)


def _uncertainty(fix: Fix) -> int:
    return MOST_UNCERTAIN if fix.horizontal is None else fix.horizontal


def _position_of(fix: Fix) -> Position:
    return Position(fix.latitude or 0, fix.longitude or 0)


def _position(configured: ConfiguredPosition | None) -> Position:
    if configured is None:
        return Position()
    return Position(round(configured.latitude * 1e7), round(configured.longitude * 1e7))


def _degrees(latitude: int | None, longitude: int | None) -> dict[str, object]:
    return {"latitude": _scaled(latitude, 1e7), "longitude": _scaled(longitude, 1e7)}


def _told(fix: Fix) -> dict[str, object]:
    """Return a fix for the status. Members are null if unknown, and absent without a fresh fix.

    fix           `none`, `dead_reckoning`, `flat` (2D), `full` (3D), `combined` or `time_only`.
    carrier       carrier phase: `none`, `float` or `fixed` (RTK).
    altitude_m    metres above the ellipsoid.
    horizontal_m  horizontal accuracy, one standard deviation.
    vertical_m    vertical accuracy, one standard deviation.
    speed_m_s     speed over ground in m/s.
    heading_deg   direction of motion in degrees from north.
    satellites    number of satellites in use.
    """
    return _degrees(fix.latitude, fix.longitude) | {
        "fix": fix.kind.name.lower(),
        "carrier": fix.carrier.name.lower(),
        "altitude_m": _scaled(fix.altitude, 1e3),
        "horizontal_m": _scaled(fix.horizontal, 1e3),
        "vertical_m": _scaled(fix.vertical, 1e3),
        "speed_m_s": _scaled(fix.speed, 1e3),
        "heading_deg": _scaled(fix.heading, 1e5),
        "satellites": fix.satellites,
    }


def _scaled(value: int | None, by: float) -> float | None:
    return None if value is None else value / by
