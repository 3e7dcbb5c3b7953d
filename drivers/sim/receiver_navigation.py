"""What a simulated receiver has found since it booted: satellites, leap seconds, and ambiguities by corrections."""

from board.time import Carrier, FixKind
from drivers.sim.receiver_habits import Habits
from drivers.sim.receiver_messages import Moment, Sky
from drivers.sim.track import Track

HOT_S = 1.5  # from a reset that forgets nothing to a fix
COLD = 0xFFFF  # what a CFG-RST that forgets all forgets
# Since corrections came first, without a pause of RTK_OLD_S between.
RTK_FLOAT_S, RTK_FIXED_S, RTK_OLD_S = 2.0, 8.0, 30.0


class Navigation:
    """From one boot to the next. Moments are in seconds of a monotonic clock."""

    def __init__(self, habits: Habits, track: Track, now: float) -> None:
        self._habits = habits
        self._track = track
        self._booted = self._searching = now
        self._is_cold = True
        self._corrected: tuple[float, float] | None = None  # since when, and when last

    def reset(self, is_cold: bool, now: float) -> None:
        """Search for satellites anew."""
        self._searching, self._is_cold = now, is_cold

    def correct(self, now: float) -> None:
        """A correction came."""
        since = self._corrected[0] if self._corrected else now
        self._corrected = (since, now)

    def moment(self, gps_ms: int, sky: Sky, now: float) -> Moment:
        """All that is known at an epoch."""
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
        """How far the ambiguities are resolved, and the age of corrections as a row of CORRECTION_AGE_S."""
        if self._corrected is None or now - self._corrected[1] > RTK_OLD_S:
            self._corrected = None
            return Carrier.NONE, 0
        since, last = self._corrected
        age = 1 + sum(now - last > most for most in (1, 2, 5, 10, 15, 20))
        if now - since < RTK_FLOAT_S:
            return Carrier.NONE, age
        return (Carrier.FIXED if now - since >= RTK_FIXED_S else Carrier.FLOAT), age
