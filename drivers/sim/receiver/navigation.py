"""Navigation state of a simulated receiver since boot: satellites, leap seconds, ambiguities."""

from board.time.scales import Carrier, FixKind
from drivers.sim.receiver.habits import Habits
from drivers.sim.receiver.messages import Moment, Sky
from drivers.sim.track import Track

HOT_S = 1.5  # seconds from a hot start to a fix
COLD = 0xFFFF  # value of CfgRst.forget for a cold start
# Seconds since the first correction until float and fixed; a pause of RTK_OLD_S restarts the count.
RTK_FLOAT_S, RTK_FIXED_S, RTK_OLD_S = 2.0, 8.0, 30.0


class Navigation:
    """Navigation state from one boot to the next. Times are in seconds of a monotonic clock."""

    def __init__(self, habits: Habits, track: Track, now: float) -> None:
        self._habits = habits
        self._track = track
        self._booted = self._searching = now
        self._is_cold = True
        self._corrected: tuple[float, float] | None = None  # times of the first and the last correction

    def reset(self, is_cold: bool, now: float) -> None:
        """Restart the search for satellites."""
        self._searching, self._is_cold = now, is_cold

    def correct(self, now: float) -> None:
        """Process the arrival of a correction."""
        since = self._corrected[0] if self._corrected else now
        self._corrected = (since, now)

    def moment(self, gps_ms: int, sky: Sky, now: float) -> Moment:
        """Return the state of the receiver at an epoch."""
        searched = now - self._searching
        has_fix = sky.satellites > 3 and searched >= (self._habits.fix_s if self._is_cold else HOT_S)
        is_resolved = searched >= self._habits.leap_s or not self._is_cold
        carrier, age = self._rtk(now) if has_fix else (Carrier.NONE, 0)
        return Moment(
            gps_ms,
            self._habits.leap,
            is_resolved,
            self._habits.default_leap,
            FixKind.FULL if has_fix else FixKind.NONE,
            carrier,
            age,
            self._track.at(gps_ms / 1000 - self._habits.gps_s),
            sky,
            round((now - self._booted) * 1000),
            round(self._habits.fix_s * 1000),
        )

    def _rtk(self, now: float) -> tuple[Carrier, int]:
        """Return the carrier solution, and the age of corrections as an index in CORRECTION_AGE_S."""
        if self._corrected is None or now - self._corrected[1] > RTK_OLD_S:
            self._corrected = None
            return Carrier.NONE, 0
        since, last = self._corrected
        age = 1 + sum(now - last > most for most in (1, 2, 5, 10, 15, 20))
        if now - since < RTK_FLOAT_S:
            return Carrier.NONE, age
        return (Carrier.FIXED if now - since >= RTK_FIXED_S else Carrier.FLOAT), age
