"""NMEA epochs: combines the sentences of one epoch to a Fix."""

from board.time.scales import Carrier, Fix, FixKind
from drivers.wire.gnss.nmea import Clock, Gga, Gsa, Message, Rmc, Vtg, Zda
from drivers.wire.gnss.time import civil_ns

# Values of GGA's quality: fixes with carrier phase, and dead reckoning without satellites.
_CARRIERS = {4: Carrier.FIXED, 5: Carrier.FLOAT}
_DEAD_RECKONING = 6

# Range error in mm (one standard deviation) by GGA's quality; hdop multiplies it. No standard defines these values.
# Receivers reach them between houses: autonomous, with differential corrections, and with the carrier phase. For
# other qualities the error is unknown.
_RANGE_ERROR_MM = {1: 5000, 2: 1500, 3: 5000, 4: 20, 5: 500}
_NO_HDOP = 99.0  # receivers send 99.99 for an unknown hdop

Timed = Gga | Rmc | Zda


class NmeaEpochs:
    """Combines sentences to fixes. An epoch is complete with the same types of sentences as the epoch before.

    Each receiver sends its own selection of sentences. NMEA gives no accuracy in metres, so it is estimated from hdop.
    NMEA also does not report if the receiver knows the leap seconds.
    """

    def __init__(self) -> None:
        self._clock: Clock | None = None
        self._parts: dict[type, Timed] = {}  # sentences of the current epoch
        self._wanted: set[type] = {Gga, Rmc}
        self._is_told = False
        self._is_flat = False
        self._hdop: float | None = None  # from the last GSA
        self._vtg = Vtg(None, None)

    def take(self, message: Message, now: float) -> Fix | None:
        """Process a sentence; return the Fix if the sentence completes its epoch."""
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
        sentence = rmc if gga is None else gga
        if kind is FixKind.NONE or sentence is None or sentence.latitude is None or sentence.longitude is None:
            return Fix(now, satellites=satellites)
        motion = rmc if rmc is not None else self._vtg
        return Fix(
            now,
            kind,
            latitude=sentence.latitude,
            longitude=sentence.longitude,
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
        """Estimate the horizontal accuracy in mm. RMC alone gives no quality and counts as autonomous."""
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
    """Return the altitude above the ellipsoid in mm."""
    if gga is None or gga.altitude_mm is None:
        return None
    return gga.altitude_mm + (gga.separation_mm or 0)
