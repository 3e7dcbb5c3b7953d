"""Fixes of a GNSS receiver: converts NAV-PVT to a Fix, and detects implausible jumps."""

from math import cos, hypot, radians

from board.time.scales import Carrier, Fix, FixKind
from drivers.wire.gnss.time import WEEK, utc_ns
from drivers.wire.ublox.messages import NavPvt

METRES = 0.0111319  # length of 1e-7 degree on a great circle, at the WGS84 equator


def fix_of(pvt: NavPvt, now: float) -> Fix:
    """Convert a NAV-PVT to a Fix.

    Without gnssFixOK the Fix has no position, only the time, because the position exceeds the receiver's accuracy
    limits.
    """
    utc = utc_ns(pvt)
    accuracy = pvt.time_accuracy_ns if utc is not None else None
    tow = pvt.itow_ms if pvt.is_time_valid and pvt.itow_ms < WEEK * 1000 else None
    kind = FixKind(pvt.fix_type) if pvt.fix_type <= max(FixKind) and pvt.is_fix_ok else FixKind.NONE
    if kind in (FixKind.NONE, FixKind.TIME_ONLY) or pvt.is_position_invalid:
        kind = FixKind.TIME_ONLY if kind is FixKind.TIME_ONLY else FixKind.NONE
        return Fix(now, kind, satellites=pvt.satellites, utc_ns=utc, utc_accuracy_ns=accuracy, tow_ms=tow)
    is_flat = kind is FixKind.FLAT
    return Fix(
        now,
        kind,
        latitude=pvt.latitude,
        longitude=pvt.longitude,
        altitude=None if is_flat else pvt.height_mm,
        horizontal=pvt.horizontal_mm,
        vertical=None if is_flat else pvt.vertical_mm,
        speed=max(0, pvt.speed_mm_s),
        heading=pvt.heading % 36_000_000,
        satellites=pvt.satellites,
        carrier=Carrier(min(pvt.carrier, Carrier.FIXED)),
        utc_ns=utc,
        utc_accuracy_ns=accuracy,
        tow_ms=tow,
    )


def distance(one: Fix, other: Fix) -> float:
    """Return the metres between two known positions, to 1 % up to about 100 km."""
    assert one.latitude is not None
    assert one.longitude is not None
    assert other.latitude is not None
    assert other.longitude is not None
    north = other.latitude - one.latitude
    east = (other.longitude - one.longitude + 1_800_000_000) % 3_600_000_000 - 1_800_000_000
    return METRES * hypot(north, east * cos(radians((one.latitude + other.latitude) / 2e7)))


class Jumps:
    """Detector of implausible jumps: positions that no vehicle can reach from the previous one in the elapsed time.

    After CONFIRMED consistent epochs, the new position is accepted. Otherwise a receiver that recovers from a long
    error would be refused for ever.
    """

    SPEED = 150.0  # m/s: above the speed of any road vehicle
    SLACK = 1000.0  # m: the error of a first fix between buildings is hundreds of metres
    CONFIRMED = 5  # consistent epochs until a jump is accepted

    def __init__(self) -> None:
        self.count = 0  # jumps detected
        self.metres = 0.0  # length of the last jump
        self._believed: Fix | None = None
        self._doubted: Fix | None = None
        self._agreeing = 0

    def is_believed(self, fix: Fix) -> bool:
        """Return False for a fix that is an implausible jump; fix must have a position."""
        if self._believed is None or self._follows(fix, self._believed):
            self._believe(fix)
            return True
        if self._doubted is not None and self._follows(fix, self._doubted):
            self._agreeing += 1
        else:
            self.count += 1
            self.metres = distance(self._believed, fix)
            self._agreeing = 1
        self._doubted = fix
        if self._agreeing < self.CONFIRMED:
            return False
        self._believe(fix)
        return True

    def _believe(self, fix: Fix) -> None:
        self._believed, self._doubted = fix, None

    def _follows(self, fix: Fix, before: Fix) -> bool:
        return distance(before, fix) <= self.SLACK + self.SPEED * (fix.monotonic - before.monotonic)
