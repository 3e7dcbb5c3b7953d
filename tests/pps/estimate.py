"""Stations with a calm crystal, for tests of the estimate."""

from typing import Any

from board.time.leaps import BUILT_IN
from board.time.scales import Fix, FixKind, TimeQuality
from pps.sim.oscillator import START_NS, Crystal
from pps.sim.temperature import Temperature
from tests.pps.station import SECOND_NS, Station

HOUR = 3600

# A crystal that keeps still, and air that does: what is seen is the estimator.
CALM = Crystal(white_ppb=0.3, flicker_ppb=1, walk_ppb=0.005)
EVEN = Temperature(diurnal_k=0)

# The worst that is built in: a parabola, far from its turning point, and quick.
LIVELY = Crystal(linear_ppb=0, quadratic_ppb=-34, cubic_ppb=0, thermal_s=45)


def steady(seconds: int = 600, seed: int = 1, **options: Any) -> Station:
    """A station with a calm crystal that has had pulses for so long."""
    station = Station(seed, crystal=CALM, air=EVEN, base_ns=5_000, **options)
    station.pulses(range(2, 2 + seconds))
    return station


def quality(station: Station, second: float) -> TimeQuality:
    return station.estimator.quality(station.machine.clocks(START_NS + round(second * SECOND_NS)))


def fix(station: Station, epoch: float, late_s: float) -> Fix:
    its_ns = START_NS + round(epoch * SECOND_NS)
    monotonic = station.machine.clocks(its_ns + round(late_s * SECOND_NS)).monotonic
    return Fix(monotonic, FixKind.FULL, utc_ns=BUILT_IN.unix_ns(its_ns))
