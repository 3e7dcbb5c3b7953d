"""Generation rules of CAMs: EN 302 637-2 V1.4.1 clause 6.1.3."""

from math import cos, hypot, radians
from typing import NamedTuple

from drivers.sim.track import METRES, Motion

MIN_S, MAX_S = 0.1, 1.0  # T_GenCamMin, T_GenCamMax
CHECK_S = 0.1  # T_CheckCamGen: at most T_GenCamMin
REPEATS = 3  # N_GenCam: after a CAM caused by movement, this number of CAMs follows at the same interval
LOW_FREQUENCY_S = 0.5  # between two low-frequency containers at least
ROUNDING_S = 1e-6  # tolerance for checks at a whole number of periods
HEADING_DEGREES, DISTANCE_M, SPEED_M_S = 4.0, 4.0, 0.5


class Generation:
    """Generation rules for one vehicle.

    dcc_s  T_GenCam_DCC: least time between two CAMs that the channel load permits; 0.1 to 1 s.
    """

    def __init__(self, dcc_s: float = MIN_S) -> None:
        self._dcc_s = min(max(dcc_s, MIN_S), MAX_S)
        self._period_s = MAX_S  # T_GenCam
        self._left = 0  # CAMs left of REPEATS
        self._last: float | None = None
        self._motion: Motion | None = None
        self._low_frequency: float | None = None

    def is_due(self, now: float, motion: Motion) -> bool:
        """Whether a CAM is to be generated at this check; if so, it counts as generated."""
        if self._last is None or self._motion is None:
            self._generated(now, motion)
            return True
        elapsed = now - self._last
        if elapsed < self._dcc_s - ROUNDING_S:
            return False
        if has_moved(self._motion, motion):
            # First condition: from now on, CAMs follow at the interval that the movement causes.
            self._period_s, self._left = min(elapsed, MAX_S), REPEATS
        elif elapsed < self._period_s - ROUNDING_S:
            return False
        else:
            self._left = max(0, self._left - 1)
            if not self._left:
                self._period_s = MAX_S
        self._generated(now, motion)
        return True

    def has_low_frequency(self, now: float) -> bool:
        """Whether the present CAM needs the low-frequency container: the first one, then one at least 500 ms later."""
        if self._low_frequency is not None and now - self._low_frequency < LOW_FREQUENCY_S - ROUNDING_S:
            return False
        self._low_frequency = now
        return True

    def _generated(self, now: float, motion: Motion) -> None:
        self._last, self._motion = now, motion


class Moved(NamedTuple):
    """Difference between two motions: heading in degrees, distance in metres, speed in metres per second."""

    heading: float
    distance_m: float
    speed_m_s: float


def moved(one: Motion, other: Motion) -> Moved:
    turn = abs(other.heading - one.heading) / 1e5
    north = (other.latitude - one.latitude) * 1e-7 * METRES
    east = (other.longitude - one.longitude) * 1e-7 * METRES * cos(radians(one.latitude * 1e-7))
    return Moved(min(turn, 360.0 - turn), hypot(north, east), abs(other.speed_mm_s - one.speed_mm_s) / 1000)


def has_moved(one: Motion, other: Motion) -> bool:
    """Whether heading changed by more than 4 degrees, position by 4 m, or speed by 0.5 m/s: the first condition."""
    change = moved(one, other)
    return change.heading > HEADING_DEGREES or change.distance_m > DISTANCE_M or change.speed_m_s > SPEED_M_S
