"""Own position: the best fresh fix of any receiver, else the configured one; and what is not believed."""

import json
from collections.abc import Iterator

import pytest

from board.time.scales import EPOCH, Carrier, Fix, FixKind, LeapEvent, TimeMark, its_time_ms
from drivers.message import Position
from firmware.clock.own_time import HOLDOVER_S
from firmware.config.tables import ConfiguredPosition
from firmware.station.position import FRESH_S, OwnPosition

NOW = 1_795_182_426.0
INGOLSTADT = Fix(
    100.0,
    FixKind.FULL,
    latitude=487_668_616,
    longitude=114_320_680,
    altitude=373_000,
    horizontal=1_200,
    vertical=2_000,
    speed=13_890,
    heading=4_512_345,
    satellites=14,
    carrier=Carrier.FLOAT,
)
CONFIGURED = ConfiguredPosition(48.0, 11.0)


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[Clock]:
    clock = Clock()
    monkeypatch.setattr("firmware.clock.own_time.time.time", lambda: NOW + clock.now - 100.0)
    return clock


@pytest.fixture
def own_position(clock: Clock) -> OwnPosition:
    return OwnPosition(clock, CONFIGURED, is_mobile=False)


def test_without_a_receiver_it_is_the_configured_position(own_position: OwnPosition) -> None:
    ego = own_position.ego()
    assert (ego.position, ego.is_known, ego.speed) == (Position(480_000_000, 110_000_000), True, 0)
    assert ego.its_ms == its_time_ms(NOW, 5)
    assert own_position.status()["source"] == "configured"


def test_without_either_it_is_unknown(clock: Clock) -> None:
    own_position = OwnPosition(clock, None, is_mobile=False)
    assert not own_position.ego().is_known
    assert (own_position.status()["source"], own_position.status()["latitude"]) == ("", None)


def test_a_fix_gives_position_speed_and_heading_in_the_units_of_a_position_vector(own_position: OwnPosition) -> None:
    own_position.fix("gnss", INGOLSTADT)
    ego = own_position.ego()
    assert ego.position == Position(487_668_616, 114_320_680)
    assert (ego.is_known, ego.speed, ego.heading) == (True, 1389, 451)


def test_the_time_of_a_position_is_that_of_its_fix(own_position: OwnPosition, clock: Clock) -> None:
    own_position.fix("gnss", INGOLSTADT)
    clock.now += 0.8
    assert own_position.ego().its_ms == its_time_ms(NOW, 5)


def test_what_a_receiver_does_not_know_is_nothing(own_position: OwnPosition) -> None:
    own_position.fix("gnss", Fix(100.0, FixKind.FULL, 487_668_616, 114_320_680))
    assert (own_position.ego().speed, own_position.ego().heading, own_position.ego().is_known) == (0, 0, True)


def test_a_position_of_unknown_accuracy_is_known_and_not_called_accurate(own_position: OwnPosition) -> None:
    assert own_position.ego().is_accurate
    own_position.fix("gnss", INGOLSTADT._replace(horizontal=None))
    assert (own_position.ego().is_known, own_position.ego().is_accurate) == (True, False)
    own_position.fix("gnss", INGOLSTADT)
    assert own_position.ego().is_accurate


@pytest.mark.parametrize("heading", [35_999_999, 36_000_000])
def test_a_heading_is_below_a_whole_turn(own_position: OwnPosition, heading: int) -> None:
    own_position.fix("gnss", INGOLSTADT._replace(heading=heading))
    assert own_position.ego().heading == 0


def test_an_old_fix_is_none(own_position: OwnPosition, clock: Clock) -> None:
    own_position.fix("gnss", INGOLSTADT)
    clock.now += FRESH_S + 0.1
    assert own_position.ego().position == Position(480_000_000, 110_000_000)
    assert own_position.status()["source"] == "configured"


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": FixKind.NONE},
        {"kind": FixKind.TIME_ONLY},
        {"latitude": None},
        {"longitude": None},
        {"horizontal": 40_001},
    ],
)
def test_a_fix_that_says_nothing_certain_is_not_used(own_position: OwnPosition, wrong: dict[str, object]) -> None:
    own_position.fix("gnss", INGOLSTADT._replace(**wrong))
    assert own_position.status()["source"] == "configured"


def test_of_two_receivers_the_more_certain_is_used_while_it_is_fresh(own_position: OwnPosition, clock: Clock) -> None:
    own_position.fix("modem", INGOLSTADT._replace(horizontal=5_000))
    own_position.fix("gnss", INGOLSTADT._replace(horizontal=20))
    assert own_position.status()["source"] == "gnss"
    own_position.fix("modem", INGOLSTADT._replace(horizontal=5_000, monotonic=101.0))
    assert own_position.status()["source"] == "gnss"
    clock.now = 100.0 + FRESH_S + 0.5
    own_position.fix("modem", INGOLSTADT._replace(horizontal=5_000, monotonic=clock.now))
    assert own_position.status()["source"] == "modem"


def test_before_the_clock_is_set_the_position_counts_as_unknown(
    own_position: OwnPosition, monkeypatch: pytest.MonkeyPatch
) -> None:
    own_position.fix("gnss", INGOLSTADT)
    for utc_s in (12.0, EPOCH - 1.0):
        monkeypatch.setattr("firmware.clock.own_time.time.time", lambda utc_s=utc_s: utc_s)
        assert (own_position.ego().its_ms, own_position.ego().is_known) == (0, False)


def test_a_mobile_station_that_lost_its_receiver_is_not_at_the_configured_place(clock: Clock) -> None:
    own_position = OwnPosition(clock, CONFIGURED, is_mobile=True)
    assert own_position.ego().is_known
    own_position.fix("gnss", INGOLSTADT)
    clock.now += FRESH_S + 0.1
    ego = own_position.ego()
    assert (ego.position, ego.is_known, ego.speed) == (Position(487_668_616, 114_320_680), False, 0)
    assert (own_position.status()["source"], own_position.status()["latitude"]) == ("", None)


def test_a_station_that_never_moves_is_where_it_was_when_it_loses_its_receiver(clock: Clock) -> None:
    own_position = OwnPosition(clock, None, is_mobile=False)
    own_position.fix("gnss", INGOLSTADT)
    clock.now += 3600.0
    assert (own_position.ego().position, own_position.ego().is_known) == (Position(487_668_616, 114_320_680), True)
    assert (own_position.status()["source"], own_position.status()["latitude"]) == ("last fix", 48.7668616)


TIMED = INGOLSTADT._replace(utc_ns=round((NOW + 7200.25) * 1e9), utc_accuracy_ns=22)  # by which the clock is wrong


@pytest.mark.parametrize("system_s", [12.0, NOW, NOW * 4])
def test_a_position_has_the_time_of_its_receiver_whatever_the_clock_of_the_system_says(
    own_position: OwnPosition, clock: Clock, monkeypatch: pytest.MonkeyPatch, system_s: float
) -> None:
    monkeypatch.setattr("firmware.clock.own_time.time.time", lambda: system_s)
    own_position.fix("gnss", TIMED)
    clock.now += 0.8
    assert (own_position.ego().its_ms, own_position.ego().is_known) == (its_time_ms(NOW + 7200.25, 5), True)


def test_a_receivers_time_goes_on_by_the_monotonic_clock_for_an_hour(own_position: OwnPosition, clock: Clock) -> None:
    own_position.fix("gnss", TIMED)
    own_position.fix("gnss", Fix(101.0))  # it has lost its satellites
    clock.now += HOLDOVER_S
    assert own_position.ego().its_ms == its_time_ms(NOW + 7200.25 + HOLDOVER_S, 5)
    clock.now += 1.0
    assert own_position.ego().its_ms == its_time_ms(NOW + HOLDOVER_S + 1.0, 5)


def test_where_the_clock_of_the_system_is_not_set_a_receivers_time_goes_on_as_long_as_it_has_to(
    own_position: OwnPosition, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("firmware.clock.own_time.time.time", lambda: clock.now)
    own_position.fix("gnss", TIMED)
    clock.now += 86_400.0
    assert (own_position.ego().its_ms, own_position.ego().is_known) == (its_time_ms(NOW + 7200.25 + 86_400.0, 5), True)


def test_a_receiver_without_a_position_gives_its_time(own_position: OwnPosition) -> None:
    own_position.fix("gnss", Fix(100.0, FixKind.TIME_ONLY, utc_ns=TIMED.utc_ns, utc_accuracy_ns=100))
    assert own_position.ego().its_ms == its_time_ms(NOW + 7200.25, 5)


def test_a_time_of_unknown_accuracy_stands_in_for_a_clock_that_is_not_set_alone(
    own_position: OwnPosition, monkeypatch: pytest.MonkeyPatch
) -> None:
    own_position.fix("nmea", TIMED._replace(utc_accuracy_ns=None))
    assert own_position.ego().its_ms == its_time_ms(NOW, 5)
    monkeypatch.setattr("firmware.clock.own_time.time.time", lambda: 12.0)
    assert (own_position.ego().its_ms, own_position.ego().is_known) == (its_time_ms(NOW + 7200.25, 5), True)


@pytest.mark.parametrize("year_s", [0.0, EPOCH - 1.0, 1e10])
def test_a_time_that_cannot_be_is_not_taken(own_position: OwnPosition, year_s: float) -> None:
    own_position.fix("gnss", INGOLSTADT._replace(utc_ns=round(year_s * 1e9), utc_accuracy_ns=22))
    assert own_position.ego().its_ms == its_time_ms(NOW, 5)


def test_leap_seconds_of_a_mark_alone_are_not_believed(own_position: OwnPosition) -> None:
    own_position.time_mark("gnss", TimeMark(100.0, None, 25, None, False, 19))
    assert own_position.ego().its_ms == its_time_ms(NOW, 5)


def test_an_old_time_mark_is_none(own_position: OwnPosition, clock: Clock) -> None:
    own_position.time_mark("gnss", TimeMark(100.0, 1_795_182_427, 25, -312, True, 18))
    assert own_position.mark_of("gnss") is not None
    clock.now += FRESH_S + 0.1
    assert own_position.mark_of("gnss") is None
    assert own_position.status()["time_mark"] is None


def test_the_status_is_in_degrees_metres_and_seconds(own_position: OwnPosition, clock: Clock) -> None:
    own_position.fix("gnss", INGOLSTADT)
    event = LeapEvent(725_846_405, 1)  # 2026-12-31T23:59:60Z
    own_position.time_mark("gnss", TimeMark(100.0, 1_795_182_427, 25, -312, True, 18, 722_267_232, event))
    clock.now += 0.5
    assert json.loads(json.dumps(own_position.status())) == {
        "latitude": 48.7668616,
        "longitude": 11.432068,
        "fix": "full",
        "carrier": "float",
        "altitude_m": 373.0,
        "horizontal_m": 1.2,
        "vertical_m": 2.0,
        "speed_m_s": 13.89,
        "heading_deg": 45.12345,
        "satellites": 14,
        "source": "gnss",
        "age_s": 0.5,
        "time_mark": {
            "source": "gnss",
            "age_s": 0.5,
            "utc_s": 1_795_182_427,
            "accuracy_ns": 25,
            "quantisation_ps": -312,
            "is_locked": True,
            "leap_seconds": 18,
            "its_s": 722_267_232,
            "leap_event": {"its_s": 725_846_405, "change": 1},
        },
    }


def test_its_ms_goes_on_between_two_looks_and_follows_a_clock_that_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [10.0]
    own_position = OwnPosition(lambda: now[0], None, True)
    told = [5_000, 9_000]
    monkeypatch.setattr(own_position.time, "its_ms", lambda monotonic: told.pop(0))
    assert own_position.its_ms() == 5_000
    now[0] = 10.5
    assert own_position.its_ms() == 5_500
    now[0] = 11.0
    assert own_position.its_ms() == 9_000


def test_its_ms_is_0_while_nobody_knows_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    own_position = OwnPosition(lambda: 10.0, None, True)
    monkeypatch.setattr(own_position.time, "its_ms", lambda monotonic: None)
    assert own_position.its_ms() == 0
