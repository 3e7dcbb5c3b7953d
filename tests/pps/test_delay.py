"""One-way delays between two stations, each by its own clock, beside the truth; pytest -s prints the figures."""

from collections.abc import Iterator
from random import Random

import pytest

from board.runtime.errors import RequestError
from board.time.scales import Lock, TimeQuality
from pps.delay import Delay, Stamp, one_way
from pps.sim.oscillator import START_NS
from pps.sim.temperature import Temperature, engine, fan
from tests.pps.station import SECOND_NS, Sample, Station, figures

HOUR = 3600
PERIOD_S = 0.5  # of messages
SETTLED_S = 30  # from then on both know their time


def stamp(station: Station, true_ns: int) -> Stamp:
    """A message at a station at a true time: stamped by its system's clock, with what it says of that then."""
    clocks = station.machine.clocks(true_ns)
    return Stamp(clocks.system_ns, station.estimator.quality(clocks))


def steered(seed: int, **options: object) -> Station:
    """A station whose system's clock is 3 ms wrong at first, stepped and slewed by what disciplines it, and so on."""
    station = Station(seed, system_error_ns=3_000_000, **options)  # type: ignore[arg-type]
    for at_s in range(60, 2 * HOUR, 600):
        now_ns = START_NS + at_s * SECOND_NS
        station.machine.step(now_ns, station.machine.system_offset_ns(now_ns) + 200_000)
        station.machine.slew(now_ns, -station.oscillator.frequency_ppb(now_ns) + 50)
    return station


def delays(sender: Station, receiver: Station, hours: float, silent: tuple[int, int] = (0, 0)) -> Iterator[Sample]:
    """Messages for so long, under way for 2 ms and some more; the receiver has no pulses while it is silent."""
    random = Random(1)
    for second in range(2, round(hours * HOUR)):
        sender.paired_pulse(second)
        if not silent[0] <= second < silent[1]:
            receiver.paired_pulse(second)
        for number in range(2) if second >= SETTLED_S else ():
            sent_ns = START_NS + round((second + 0.09 + number * PERIOD_S) * SECOND_NS)
            truth_ns = 2_000_000 + round(random.expovariate(1 / 1_500_000))
            delay = one_way(stamp(sender, sent_ns), stamp(receiver, sent_ns + truth_ns))
            yield Sample(second, delay.ns - truth_ns, delay.uncertainty_ns)


def test_a_delay_is_within_its_uncertainty_and_that_is_not_wide():
    # Boards as they are drawn. How late the interrupts of each are is most of the error and cannot be known: between
    # two that happen to be alike there is little, and the uncertainty is that of any two. So it is compared over pairs.
    warm = Temperature(ramps=engine(1200, 15, 600) + fan(1, 600, HOUR))
    together: list[Sample] = []
    for sender, receiver in ((11, 12), (13, 14), (17, 18)):
        samples = list(delays(steered(sender), steered(receiver, air=warm), hours=1))
        print(f"\ndelays from station {sender} to {receiver}: {figures(samples)}")
        assert figures(samples).covered >= 0.999
        together += samples
    print(f"of all: {figures(together)}")
    assert figures(together).ratio <= 5


def test_a_delay_is_within_its_uncertainty_while_one_end_has_no_pulses_for_half_an_hour():
    warm = Temperature(ramps=engine(1500, 15, 600))
    samples = list(delays(steered(15), steered(16, air=warm), hours=1.2, silent=(1500, 3300)))
    silent = [sample for sample in samples if 1560 < sample.second < 3300]
    print(f"\ndelays with a silence of 30 min: {figures(samples)}")
    print(f"  in the silence: {figures(silent)}")
    assert figures(samples).covered >= 0.999
    assert figures(silent).covered >= 0.999
    assert figures(samples).ratio <= 5


def test_uncertainties_are_added():
    sent = Stamp(1_000_000_000, TimeQuality(Lock.LOCKED, offset_ns=-200, uncertainty_ns=5_000))
    received = Stamp(1_004_000_000, TimeQuality(Lock.HOLDOVER, offset_ns=1_000, uncertainty_ns=70_000))
    assert one_way(sent, received) == Delay(4_001_200, 75_000)


def test_a_delay_may_come_out_below_zero_by_as_much_as_it_is_uncertain():
    sent = Stamp(1_000_000_000, TimeQuality(Lock.LOCKED, 0, 5_000))
    received = Stamp(1_000_000_000 - 4_000, TimeQuality(Lock.LOCKED, 0, 5_000))
    assert one_way(sent, received) == Delay(-4_000, 10_000)


@pytest.mark.parametrize("end", ["sender", "receiver"])
def test_there_is_no_delay_where_an_end_does_not_know_how_good_its_clock_is(end: str):
    known, unknown = Stamp(10**9, TimeQuality(Lock.LOCKED, 0, 5_000)), Stamp(10**9, TimeQuality())
    with pytest.raises(RequestError, match=f"{end}'s clock is of unknown quality .time is UNKNOWN"):
        one_way(*((unknown, known) if end == "sender" else (known, unknown)))
