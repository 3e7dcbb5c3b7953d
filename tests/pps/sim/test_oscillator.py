"""The simulated crystal, machine and interrupts: what they do is what such parts are known to do, and is the truth."""

import itertools
from random import Random

import pytest

from board.time.leaps import BUILT_IN
from pps.sim.interrupts import Edges, Interrupts
from pps.sim.machine import Machine
from pps.sim.oscillator import INFLECTION_C, START_NS, Crystal, Oscillator, drawn
from pps.sim.temperature import Ramp, Temperature, clouds, engine, fan
from tests.test_imports import ROOT, imports, is_within

SECOND = 1_000_000_000
CALM = Crystal(white_ppb=0, flicker_ppb=0, walk_ppb=0, ageing_ppb=0)
EVEN = Temperature(mean_c=INFLECTION_C, diurnal_k=0)


def test_what_judges_a_clock_cannot_know_how_it_was_made():
    others = list((ROOT / "pps").glob("*.py"))
    assert others
    for path in others:
        assert not any(is_within(name, "pps.sim") for name in imports(path.read_text(), path)), path


def oscillator(seed: int = 1, crystal: Crystal | None = None, temperature: Temperature = EVEN) -> Oscillator:
    return Oscillator(crystal or drawn(seed), temperature, seed)


@pytest.mark.parametrize("seed", range(5))
def test_what_it_shows_and_what_is_true_then_are_one_to_one(seed: int):
    clock, random = oscillator(seed, temperature=Temperature(ramps=engine(20_000))), Random(seed)
    for _ in range(2_000):
        its_ns = START_NS + random.randrange(86_400 * SECOND)
        assert abs(clock.its_ns(clock.raw_ns(its_ns)) - its_ns) <= 1


def test_the_same_seed_is_the_same_clock_in_whatever_order_it_is_asked():
    one, other = oscillator(3), oscillator(3)
    late = START_NS + 10_000 * SECOND
    assert one.raw_ns(late) == other.raw_ns(late)
    other = oscillator(3)
    assert [other.raw_ns(START_NS + s * SECOND) for s in range(0, 10_001, 100)][-1] == one.raw_ns(late)
    assert oscillator(4).raw_ns(late) != one.raw_ns(late)


def test_a_calm_crystal_at_its_inflection_runs_by_its_offset():
    clock = oscillator(crystal=CALM)
    assert clock.raw_ns(START_NS + 1000 * SECOND) - clock.raw_ns(START_NS) == 1000 * SECOND - 7_000 * 1000


def test_it_follows_the_air_with_its_time_constant():
    step = Temperature(mean_c=INFLECTION_C, diurnal_k=0, ramps=[Ramp(1000, 10)])
    clock = oscillator(crystal=CALM, temperature=step)
    before, soon, after = (clock.frequency_ppb(START_NS + s * SECOND) for s in (999, 1001 + 90, 2500))
    whole = CALM.thermal_ppb(INFLECTION_C + 10)
    assert before == CALM.offset_ppb
    assert after - before == pytest.approx(whole, rel=0.001)
    assert soon - before == pytest.approx(whole * 0.632, rel=0.05)


def test_an_at_cut_has_two_turning_points():
    slopes = [CALM.thermal_ppb(c + 1) - CALM.thermal_ppb(c) for c in range(-20, 80)]
    assert sum(a * b < 0 for a, b in itertools.pairwise(slopes)) == 2


def test_a_crystal_that_is_drawn_stays_within_its_class():
    for seed in range(200):
        for degrees_c in (0, 25, 45, 70):
            assert abs(drawn(seed).offset_ppb + drawn(seed).thermal_ppb(degrees_c)) < 50_000


def test_the_air_comes_back_to_where_it_was():
    ramps = engine(10_000) + fan(1, 20_000, 40_000) + clouds(2, 40_000, 60_000)
    air, plain = Temperature(ramps=ramps), Temperature()
    assert air.at(5_000) == plain.at(5_000)
    assert air.at(11_200) == pytest.approx(plain.at(11_200) + 20)
    assert air.at(70_000) == pytest.approx(plain.at(70_000))


def test_a_step_moves_the_system_clock_and_nothing_else():
    machine = Machine(oscillator(), system_error_ns=3_000)
    moment = START_NS + 100 * SECOND
    before = machine.clocks(moment)
    machine.step(moment, -500_000)
    after = machine.clocks(moment)
    assert (after.raw_ns, after.monotonic) == (before.raw_ns, before.monotonic)
    assert after.system_ns - before.system_ns == -500_000


def test_a_slewed_clock_gains_by_its_rate_beside_the_oscillator():
    machine = Machine(oscillator(crystal=CALM))
    machine.slew(START_NS, 7_000)
    clocks = machine.clocks(START_NS + 1000 * SECOND)
    assert abs(clocks.system_ns - BUILT_IN.unix_ns(START_NS + 1000 * SECOND)) < 100_000  # 7 ppm of 7 ppm
    assert (
        machine.system_offset_ns(START_NS + 1000 * SECOND)
        == BUILT_IN.unix_ns(START_NS + 1000 * SECOND) - clocks.system_ns
    )


def test_interrupts_are_late_and_hardly_ever_early_and_wait_beside_other_work():
    interrupts = Interrupts(1, base_ns=4_400, loads=[(1000, 2000)])
    quiet = sorted(interrupts.late_ns(s) for s in range(1000))
    busy = sorted(interrupts.late_ns(s) for s in range(1000, 2000))
    assert 4_400 <= quiet[0] < quiet[500] < 5_000
    assert quiet[990] < 8_000
    assert busy[500] < 7_000
    assert busy[950] > 20_000
    assert 100_000 < busy[-1] < 510_000


def test_an_edge_is_stamped_by_all_clocks_at_the_same_moment():
    machine = Machine(oscillator(), system_error_ns=20_000_000)
    edges = Edges(machine, Interrupts(1, base_ns=3_000), seed=2)
    pulses = [edges.edge(START_NS + s * SECOND) for s in range(1, 50)]
    edges.skip(3)
    assert edges.edge(START_NS + 60 * SECOND).sequence == pulses[-1].sequence + 4
    for number, pulse in enumerate(pulses, 1):
        truth_ns = machine.oscillator.its_ns(pulse.raw_ns)
        assert pulse.sequence == number
        assert 2_800 < truth_ns - (START_NS + number * SECOND) < 100_000
        assert BUILT_IN.unix_ns(truth_ns) - pulse.system_ns == pytest.approx(machine.system_offset_ns(truth_ns), abs=2)
