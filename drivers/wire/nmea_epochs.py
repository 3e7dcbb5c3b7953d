"""NMEA sentences of one moment put together as a Fix."""

from board.time import Carrier, Fix, FixKind
from drivers.wire.gnss_time import civil_ns
from drivers.wire.nmea import Clock, Gga, Gsa, Message, Rmc, Vtg, Zda

# GGA's quality, where the carrier phase was used, or no satellites were.
_CARRIERS = {4: Carrier.FIXED, 5: Carrier.FLOAT}
_DEAD_RECKONING = 6

# What hdop multiplies, by GGA's quality: the range error of one standard deviation, mm. No standard has these: they
# are what receivers reach between houses, autonomous, with differential corrections, and with the carrier phase. Of
# other qualities nobody knows.
_RANGE_ERROR_MM = {1: 5000, 2: 1500, 3: 5000, 4: 20, 5: 500}
_NO_HDOP = 99.0  # 99.99 stands for none

Timed = Gga | Rmc | Zda


class NmeaEpochs:
    """Which sentences a receiver sends is its own choice: a moment is complete when it has those of the last moment.

    NMEA gives no accuracy in metres: it is estimated from hdop. Nor does it say whether leap seconds are known.
    """

    def __init__(self) -> None:
        self._clock: Clock | None = None
        self._parts: dict[type, Timed] = {}  # of this moment
        self._wanted: set[type] = {Gga, Rmc}
        self._is_told = False
        self._is_flat = False
        self._hdop: float | None = None  # of the last GSA
        self._vtg = Vtg(None, None)

    def take(self, message: Message, now: float) -> Fix | None:
        """The fix of the moment that a sentence completes."""
        if isinstance(message, Gsa):
            self._is_flat, self._hdop = message.fix == 2, message.hdop
            return None
        if isinstance(message, Vtg):
            self._vtg = message
            return None
        if message.clock != self._clock or type(message) in self._parts:
            self._begin(message.clock)
        self._parts[type(message)] = message
        if self._is_told or not self._wanted <= self._parts.keys():
            return None
        self._is_told = True
        return self._fix(now)

    def _begin(self, clock: Clock | None) -> None:
        if self._parts.keys() & {Gga, Rmc}:
            self._wanted = set(self._parts)
        self._clock, self._parts, self._is_told = clock, {}, False

    def _fix(self, now: float) -> Fix:
        gga, rmc = self._parts.get(Gga), self._parts.get(Rmc)
        assert gga is None or isinstance(gga, Gga)
        assert rmc is None or isinstance(rmc, Rmc)
        kind = self._kind(gga, rmc)
        satellites = gga.satellites if gga else None
        place = rmc if gga is None else gga
        if kind is FixKind.NONE or place is None or place.latitude is None or place.longitude is None:
            return Fix(now, satellites=satellites)
        motion = rmc if rmc is not None else self._vtg
        return Fix(
            now,
            kind,
            latitude=place.latitude,
            longitude=place.longitude,
            altitude=_altitude(gga) if kind is not FixKind.FLAT else None,
            horizontal=self._horizontal(gga),
            speed=motion.speed_mm_s,
            heading=None if motion.course is None else motion.course % 36_000_000,
            satellites=satellites,
            carrier=_CARRIERS.get(gga.quality, Carrier.NONE) if gga else Carrier.NONE,
            utc_ns=self._utc_ns(rmc),
        )

    def _kind(self, gga: Gga | None, rmc: Rmc | None) -> FixKind:
        if (gga is not None and gga.quality == 0) or (rmc is not None and not rmc.is_valid):
            return FixKind.NONE
        if gga is not None and gga.quality == _DEAD_RECKONING:
            return FixKind.DEAD_RECKONING
        return FixKind.FLAT if self._is_flat or gga is None else FixKind.FULL

    def _horizontal(self, gga: Gga | None) -> int | None:
        """Estimated accuracy, mm. RMC alone has no quality: it counts as autonomous."""
        hdop = self._hdop if gga is None or gga.hdop is None else gga.hdop
        error_mm = _RANGE_ERROR_MM.get(1 if gga is None else gga.quality)
        return None if hdop is None or error_mm is None or not 0 < hdop < _NO_HDOP else round(hdop * error_mm)

    def _utc_ns(self, rmc: Rmc | None) -> int | None:
        zda = self._parts.get(Zda)
        date = rmc.date if rmc else zda.date if isinstance(zda, Zda) else None
        if date is None or self._clock is None:
            return None
        return civil_ns(*date, *self._clock)


def _altitude(gga: Gga | None) -> int | None:
    """Above the ellipsoid, mm."""
    if gga is None or gga.altitude_mm is None:
        return None
    return gga.altitude_mm + (gga.separation_mm or 0)
