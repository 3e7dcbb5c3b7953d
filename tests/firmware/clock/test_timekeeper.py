"""A station's time on the simulated board, in virtual time: what it says of itself, and that it is true."""

import json
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from board.time.scales import EPOCH, GPS_LEAD, GPS_LEAPS, Lock
from drivers.wire.gnss.time import Leap
from firmware.client.show import time_record
from firmware.clock import timekeeper
from firmware.config.tables import TimeOptions
from firmware.station import carrier
from tests.board.time.test_leap_list import listed
from tests.firmware.clock.bench import PPM, START_S, TimeBench
from tests.firmware.whole_board import NearBoardWorker
from tests.proof.chaos.stage import Ptys, StageLoop
from tests.said import tells

ROOT = Path(__file__).parents[3]
LEAP_UNIX_S = 1_483_228_800  # 2017-01-01T00:00:00Z
NEW_YEAR_UNIX_S = 1_798_761_600  # 2027-01-01, before which no table knows of a leap second
NO_LIST = TimeOptions(leap_list="")
Make = Callable[..., TimeBench]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    monkeypatch.setattr(carrier, "BoardWorker", NearBoardWorker)
    made: list[TimeBench] = []

    def make(options: TimeOptions = NO_LIST, has_pulse: bool = True, start_s: float = START_S) -> TimeBench:
        made.append(TimeBench(loop, monkeypatch, options, has_pulse, start_s))
        made[0].start()
        return made[0]

    # What a pty carries has to arrive before the clock jumps: else an epoch would be late by a second.
    with closing(StageLoop(Ptys(monkeypatch))) as loop:
        yield make
        for one in made:
            one.close()


@pytest.fixture
def bench(make: Make) -> TimeBench:
    bench = make()
    bench.until("locked")
    return bench


def assert_true(bench: TimeBench) -> None:
    """What is told of offset and ITS time is within the bound that is told with it."""
    bench.loop.run_for(1.01)  # into what is told of this second
    quality = bench.told[-1]
    assert quality.offset_ns is not None
    assert quality.uncertainty_ns is not None
    assert quality.error_ns is not None
    assert abs(quality.offset_ns - bench.offset_ns()) <= quality.uncertainty_ns
    assert abs(bench.offset_ns()) <= quality.error_ns
    its_ms = bench.own_position.time.its_ms(bench.loop.now)
    assert its_ms is not None
    assert abs(its_ms - bench.true_ns() / 1e6) <= 1.0


def test_it_goes_from_the_system_by_messages_and_settling_to_locked(make: Make) -> None:
    bench = make()
    bench.until("locked")
    states = [quality.state for quality in bench.told]
    assert sorted(set(states)) == [Lock.SYSTEM, Lock.COARSE, Lock.SETTLING, Lock.LOCKED]
    assert states == sorted(states)


def test_a_station_that_is_locked_knows_the_time_and_says_how_well(bench: TimeBench) -> None:
    bench.loop.run_for(120)
    assert_true(bench)
    quality = bench.told[-1]
    assert quality.source == "gnss"
    assert quality.uncertainty_ns is not None
    assert quality.uncertainty_ns < 10_000
    assert quality.frequency_ppb == pytest.approx(PPM * 1000, abs=100)


def test_the_status_is_json_and_has_what_is_promised(bench: TimeBench) -> None:
    status = json.loads(json.dumps(bench.keeper.status()))
    assert status["state"] == "locked"
    assert status["error_ns"] == abs(status["offset_ns"]) + status["uncertainty_ns"]
    assert (status["leap"]["table"], status["leap"]["seconds"], status["leap"]["event"]) == ("receiver", 5, None)
    assert (status["receiver"], status["pulse"]["input"], status["missing"]) == ("gnss", "simulated pulses", "")
    pulse = status["pulse"]
    assert pulse["taken"] == pulse["seconds"] + sum(one["count"] for one in pulse["refused"])
    assert {one["reason"] for one in pulse["refused"]} >= {"acquiring"}
    assert (status["refclock"], status["tracking"]) == (None, None)


def test_it_is_told_once_a_second(bench: TimeBench) -> None:
    before = len(bench.told)
    bench.loop.run_for(60.0)
    assert len(bench.told) - before == 60


def test_a_receiver_that_is_lost_leaves_a_time_whose_bound_grows_and_holds(bench: TimeBench) -> None:
    bench.loop.run_for(60)
    bench.lose()
    bench.until("holdover", within=6.0)
    bounds = []
    for _ in range(6):
        bench.loop.run_for(15)
        assert_true(bench)
        bounds.append(bench.told[-1].uncertainty_ns or 0)
    assert bounds == sorted(bounds)
    assert bounds[-1] > 5 * bounds[0]
    assert bench.keeper.status()["age_s"] == pytest.approx(100, abs=5)


def test_a_receiver_that_is_back_is_believed_again_within_seconds(bench: TimeBench) -> None:
    bench.loop.run_for(30)
    bench.lose()
    bench.until("holdover")
    bench.loop.run_for(60)
    bench.lose(is_lost=False)
    bench.until("locked", within=25.0)
    assert_true(bench)


@pytest.mark.parametrize("by_ns", [-3 * 10**9, -400_000, 37 * 10**9, 31_536_000 * 10**9])
def test_a_step_of_the_systems_clock_is_an_offset_and_no_step_of_the_time(bench: TimeBench, by_ns: int) -> None:
    bench.loop.run_for(30)
    bench.error_ns = by_ns
    assert_true(bench)
    assert bench.told[-1].offset_ns == pytest.approx(-by_ns, abs=50_000)
    bench.loop.run_for(10)
    assert bench.state() == "locked"


@pytest.mark.parametrize("ppm", [-12, 12, 500])
def test_what_is_told_of_a_second_holds_until_the_next_is_told(bench: TimeBench, ppm: int) -> None:
    """Of a system's clock that nobody steers, or that is being slewed."""
    bench.loop.run_for(10)
    for moment in range(300):
        bench.loop.run_for(0.1)
        bench.error_ns += 100 * ppm
        error_ns = bench.told[-1].error_ns
        assert error_ns is not None
        assert moment < 20 or abs(bench.offset_ns()) <= error_ns


def test_a_clock_that_was_never_set_does_not_hide_the_time(bench: TimeBench) -> None:
    bench.error_ns = -1_795_000_000 * 10**9  # in January 1970
    assert_true(bench)
    status = bench.keeper.status()
    assert (status["state"], status["leap"]["seconds"], status["leap"]["event"]) == ("locked", 5, None)
    assert bench.own_position.ego().is_known


def test_of_a_clock_that_was_never_set_no_leap_second_is_to_come(make: Make) -> None:
    bench = make()
    bench.error_ns = -1_795_000_000 * 10**9
    bench.loop.run_for(0.5)
    status = bench.keeper.status()
    assert (status["state"], status["its_ms"]) == ("unknown", None)
    assert (status["leap"]["seconds"], status["leap"]["event"]) == (None, None)


@pytest.mark.parametrize(("before", "midnight_s"), [(4, LEAP_UNIX_S), (5, NEW_YEAR_UNIX_S)])
def test_a_leap_second_is_told_before_it_comes_and_its_time_goes_through_it(
    make: Make, before: int, midnight_s: int
) -> None:
    bench = make(start_s=midnight_s - 40.0)
    leap_its_s = midnight_s - EPOCH + before
    receiver = bench.whole.module("gnss")
    receiver.habits = replace(receiver.habits, leap=Leap(GPS_LEAPS + before, leap_its_s + GPS_LEAD, 1))
    receiver._navigation = None  # made at its boot, of these habits
    bench.until("locked")
    event = bench.keeper.status()["leap"]["event"]
    year = time.gmtime(midnight_s - 1).tm_year
    assert event == {"its_s": leap_its_s, "change": 1, "utc": f"{year}-12-31T23:59:60.000Z"}
    bench.loop.run_for((leap_its_s - 3) - bench.true_ns() / 1e9)
    errors = []
    for _ in range(600):
        bench.loop.run_for(0.01)
        if bench.true_ns() >= (leap_its_s + 1) * 10**9 and not bench.error_ns:
            bench.error_ns = -(10**9)  # the kernel has let the last second of the day come twice
        its_ms = bench.own_position.time.its_ms(bench.loop.now)
        assert its_ms is not None
        errors.append(its_ms - bench.true_ns() / 1e6)
    assert min(errors) >= -1.0
    assert max(errors) <= 0.1
    bench.loop.run_for(3)
    status = bench.keeper.status()
    assert (status["state"], status["leap"]["seconds"], status["leap"]["event"]) == ("locked", before + 1, None)
    assert abs(bench.told[-1].offset_ns or 10**9) < 100_000


def test_own_time_is_the_estimate_however_wide_its_bound_is(bench: TimeBench) -> None:
    bench.lose()
    bench.until("holdover")
    bench.loop.now += 3 * 3600.0
    bench.loop.run_for(2.0)
    assert (bench.told[-1].uncertainty_ns or 0) > 20_000_000
    its_ms = bench.own_position.time.its_ms(bench.loop.now)
    assert its_ms is not None
    assert its_ms == pytest.approx(
        (bench.clocks().system_ns + (bench.told[-1].offset_ns or 0)) / 1e6 - 1000 * (EPOCH - 5), abs=2
    )


def test_own_time_never_jumps_from_the_loss_of_pulses_until_they_are_back(bench: TimeBench) -> None:
    bench.loop.run_for(60)
    bench.lose()
    errors = []

    def listen(seconds: float) -> None:
        for _ in range(round(seconds * 2)):
            bench.loop.run_for(0.5)
            its_ms = bench.own_position.time.its_ms(bench.loop.now)
            assert its_ms is not None
            errors.append(its_ms - bench.true_ns() / 1e6)

    listen(20)
    bench.lose(is_lost=False)
    listen(30)
    assert bench.state() == "locked"
    assert min(errors) >= -1.01
    assert max(errors) <= 0.1


def test_own_time_is_the_one_that_the_state_and_its_bound_are_of(make: Make) -> None:
    bench = make(has_pulse=False)
    bench.until("coarse")
    bench.loop.run_for(5.0)
    offset_ns = bench.told[-1].offset_ns
    its_ms = bench.own_position.time.its_ms(bench.loop.now)
    assert offset_ns is not None
    assert its_ms == pytest.approx((bench.clocks().system_ns + offset_ns) / 1e6 - 1000 * (EPOCH - 5), abs=2)


def test_a_wrong_count_of_leap_seconds_that_pulses_do_not_confirm_changes_nothing(bench: TimeBench) -> None:
    listener: Any = bench.whole.gnss.interface.listener
    hear = listener.time_mark
    listener.time_mark = lambda mark: hear(mark._replace(leap_seconds=19))
    for _ in range(8):
        assert_true(bench)
    status = bench.keeper.status()
    assert (status["state"], status["leap"]["seconds"]) == ("holdover", 5)


def test_leap_seconds_that_expired_are_not_logged_if_the_receiver_names_them(
    make: Make, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "leap-seconds.list"
    path.write_text(listed())
    bench = make(TimeOptions(leap_list=str(path)))
    bench.until("locked")
    bench.loop.run_for(5)
    bench.keeper._warn_of_leaps()
    assert "leap" not in caplog.text


def test_leap_seconds_that_expired_are_logged_once_whatever_a_receiver_says_then(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "leap-seconds.list"
    path.write_text(listed())
    monkeypatch.setattr(timekeeper, "LEAPS_S", 0.5)  # before the receiver has seen satellites
    bench = make(TimeOptions(leap_list=str(path)))
    bench.until("locked")
    bench.lose()
    bench.loop.run_for(5)
    bench.lose(False)
    bench.loop.run_for(5)
    told = [record.getMessage() for record in caplog.records if "leap" in record.getMessage()]
    assert told == [f"{path}: expired on 2026-06-28, like the built-in table; update tzdata"]


@pytest.mark.parametrize("is_locked", [False, True])
def test_without_pulses_leap_seconds_of_a_mark_count_if_it_is_locked(make: Make, is_locked: bool) -> None:
    bench = make(has_pulse=False)
    bench.until("coarse")
    listener: Any = bench.whole.gnss.interface.listener
    hear = listener.time_mark
    listener.time_mark = lambda mark: hear(mark._replace(leap_seconds=19, is_locked=is_locked))
    bench.loop.run_for(3.0)
    assert bench.keeper.status()["leap"]["seconds"] == (6 if is_locked else 5)


def test_what_is_asked_after_the_loop_stood_still_is_not_from_before(bench: TimeBench) -> None:
    bench.loop.run_for(10)
    bench.loop.now += 25.0
    status = bench.keeper.status()  # the timers of the station are late
    assert (status["state"], status["monotonic"]) == ("holdover", bench.loop.now)
    assert bench.told[-1].state is Lock.HOLDOVER


def test_what_a_driver_says_as_it_stops_makes_nothing(bench: TimeBench) -> None:
    bench.keeper.stop()
    assert bench.keeper._pulsed is None
    bench.loop.run_for(2.0)
    bench.keeper.stop()


def test_without_an_input_for_pulses_it_is_that_of_the_messages(make: Make) -> None:
    bench = make(has_pulse=False)
    bench.loop.run_for(30)
    status = bench.keeper.status()
    assert (status["state"], status["pulse"]) == ("coarse", None)
    assert "[pulse]" in str(status["missing"])
    assert bench.told[-1].error_ns is not None
    assert bench.told[-1].error_ns < 500_000_000


def test_keeper_with_two_receivers_needs_the_name_of_one(make: Make) -> None:
    bench = make(has_pulse=False)
    bench.keeper.stop()
    bench.keeper.start(["gnss", "second"])
    assert tells(str(bench.keeper.status()["missing"]), "gnss and second ", "pulses: ", "captain.toml", "[time]")


def test_a_second_is_kept_for_each_pulse_and_for_each_without(bench: TimeBench) -> None:
    bench.loop.run_for(30)
    bench.lose()
    bench.loop.run_for(30)
    kept = time_record.record(bench.keeper.told({"history": True})["history"])
    assert len(kept.seconds) == pytest.approx(66, abs=4)
    with_phase = [row for row in kept.seconds if row.phase_ns == row.phase_ns]
    slopes = [(b.phase_ns - a.phase_ns) / (b.its_s - a.its_s) for a, b in pairwise(with_phase)]
    assert sorted(slopes)[len(slopes) // 2] == pytest.approx(1000 * PPM, abs=2000)
    assert kept.seconds[-1].phase_ns != kept.seconds[-1].phase_ns


def test_chronyd_is_given_each_second_with_the_time_that_it_was(make: Make, tmp_path: Path) -> None:
    path = tmp_path / "chrony.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as chronyd:
        chronyd.bind(str(path))
        bench = make(TimeOptions(leap_list="", chrony=str(path), tracking=False))
        bench.error_ns = 250_000
        samples = []
        for _ in range(25):
            bench.loop.run_for(1.0)
            with suppress(BlockingIOError):
                while True:
                    samples.append(struct.unpack("@qqdiiii", chronyd.recv(64)))
        refclock = bench.keeper.status()["refclock"]
    assert len(samples) >= 10
    # Stamps are late by 3.5 to 5.5 us here, and 6 us are taken for it.
    assert all(0 < offset_s * 1e9 - bench.offset_ns() < 3000 for _, _, offset_s, *_ in samples)
    assert isinstance(refclock, dict)
    assert refclock["samples"] == {"sent": len(samples)}
    assert refclock["feeds"] is True


def test_station_without_a_receiver_imports_the_kernel_clock_alone(tmp_path: Path) -> None:
    program = f"""
import sys
from board.runtime.loop import Loop
from firmware.config import captain_toml
from firmware.station.station import Station
names = ["from_users", "to_users", "pull", "report"]
sets = [f"endpoint.{{name}}=0" for name in names] + ["endpoint.control={tmp_path}/control"]
loop = Loop()
station = Station(loop, captain_toml.load(None, sets, "pi"), captain_toml.ConfigSource())
station.start()
loop.soon(loop.stop)
loop.run()
print(sorted(name for name in sys.modules if name.startswith("pps.")))
print(station.status()["clock"]["missing"])
station.close()
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    imported, missing = done.stdout.splitlines()
    assert imported == "['pps.kernel_clock']", done.stderr
    assert tells(missing, "no interface", "pulses")
