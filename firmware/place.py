"""Where the station is, and when: the most certain receiver's fix while it is fresh, else what is configured."""

from collections.abc import Callable
from typing import NamedTuple

from board.time import Fix, FixKind, TimeMark
from drivers.message import Ego, Position
from firmware.own_time import OwnTime
from firmware.tables import Place as PlaceOptions

FRESH_S = 2.0  # receivers say one a second at least; a car drives 60 m meanwhile
# A position vector with a place less certain has no PAI: itsGnPaiInterval / 2, EN 302 636-4-1 V1.4.1 Annex H; mm.
MOST_UNCERTAIN = 40_000

PLACES = frozenset({FixKind.DEAD_RECKONING, FixKind.FLAT, FixKind.FULL, FixKind.COMBINED})


class Fallback(NamedTuple):
    """Where the station is while no fix is fresh."""

    position: Position
    is_known: bool
    source: str


class Place:
    """Own position. Drivers believe no jump of their receiver; what they give is taken.

    configured  where the station is until a receiver says something else. One that is not mobile is there again
                while no receiver says anything, or where it was last; a mobile one is then at a place that is unknown.
    """

    def __init__(self, clock: Callable[[], float], configured: PlaceOptions | None, is_mobile: bool) -> None:
        self.time = OwnTime(clock)
        self._clock = clock
        self._is_mobile = is_mobile
        is_configured = configured is not None
        self._fallback = Fallback(_position(configured), is_configured, "configured" if is_configured else "")
        self._fixes: dict[str, Fix] = {}
        self._source = ""
        self._best: Fix | None = None
        self._marks: dict[str, TimeMark] = {}
        self._marked = ""

    def fix(self, source: str, fix: Fix) -> None:
        """A receiver's solution; source is the interface that it is on."""
        self.time.fix(fix)
        if not _is_usable(fix):
            return
        self._fixes[source] = fix
        fresh = {name: one for name, one in self._fixes.items() if self._is_fresh(one)}
        self._source = min(fresh, key=lambda name: _uncertainty(fresh[name]), default=source)
        self._best = self._fixes[self._source]
        if self._is_mobile:
            self._fallback = Fallback(_place(self._best), False, "")
        elif self._fallback.source != "configured":
            self._fallback = Fallback(_place(self._best), True, "last fix")

    def time_mark(self, source: str, mark: TimeMark) -> None:
        """What a receiver says of its next pulse; the last one is kept."""
        self.time.time_mark(mark)
        self._marks[source] = mark
        self._marked = source

    def fix_of(self, source: str) -> Fix | None:
        """The last usable fix of one receiver, while it is fresh."""
        found = self._fixes.get(source)
        return found if found is not None and self._is_fresh(found) else None

    def mark_of(self, source: str) -> TimeMark | None:
        """The last time mark of one receiver, while it is fresh."""
        found = self._marks.get(source)
        return found if found is not None and self._is_fresh(found) else None

    def ego(self) -> Ego:
        """Own state.

        A position has the time of its fix. Where nobody knows the time, as in a box without a clock before its
        receiver sees the sky, the station routes all the same, and calls its position unknown, because a position
        vector without a time is none.
        """
        best = self._best
        if best is None or not self._is_fresh(best):
            its_ms = self.time.its_ms(self._clock())
            return Ego(its_ms or 0, self._fallback.position, self._fallback.is_known and its_ms is not None)
        its_ms = self.time.of_fix(best)
        if its_ms is None:
            return Ego(0, _place(best), False)
        speed, heading = round((best.speed or 0) / 10), round((best.heading or 0) / 10_000) % 3600
        return Ego(its_ms, _place(best), True, speed, heading, best.horizontal is not None)

    def status(self) -> dict[str, object]:
        """Position and time mark as the status has them: degrees, metres, seconds."""
        best = self._best
        if best is not None and self._is_fresh(best):
            said = _told(best) | {"source": self._source, "age_s": round(self._clock() - best.monotonic, 2)}
        else:
            latitude, longitude = self._fallback.position if self._fallback.is_known else (None, None)
            said = _degrees(latitude, longitude) | {"source": self._fallback.source}
        return said | {"time_mark": self._time_mark()}

    def _time_mark(self) -> dict[str, object] | None:
        mark = self.mark_of(self._marked)
        if mark is None:
            return None
        event = None if mark.leap_event is None else mark.leap_event._asdict()
        told = mark._asdict() | {"leap_event": event}
        return {"source": self._marked, "age_s": round(self._clock() - told.pop("monotonic"), 2), **told}

    def _is_fresh(self, said: Fix | TimeMark) -> bool:
        return self._clock() - said.monotonic <= FRESH_S


def _is_usable(fix: Fix) -> bool:
    is_placed = fix.kind in PLACES and fix.latitude is not None and fix.longitude is not None
    return is_placed and (fix.horizontal is None or fix.horizontal <= MOST_UNCERTAIN)


def _uncertainty(fix: Fix) -> int:
    return MOST_UNCERTAIN if fix.horizontal is None else fix.horizontal


def _place(fix: Fix) -> Position:
    return Position(fix.latitude or 0, fix.longitude or 0)


def _position(configured: PlaceOptions | None) -> Position:
    if configured is None:
        return Position()
    return Position(round(configured.latitude * 1e7), round(configured.longitude * 1e7))


def _degrees(latitude: int | None, longitude: int | None) -> dict[str, object]:
    return {"latitude": _scaled(latitude, 1e7), "longitude": _scaled(longitude, 1e7)}


def _told(fix: Fix) -> dict[str, object]:
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
