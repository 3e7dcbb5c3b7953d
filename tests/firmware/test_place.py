"""Own position: the best fresh fix of any receiver, else the configured one; and what is not believed."""

import json
from collections.abc import Iterator

import pytest

from board.time import EPOCH, Carrier, Fix, FixKind, TimeMark, its_time_ms
from drivers.message import Position
from firmware.place import FRESH_S, Place
from firmware.tables import Place as PlaceOptions

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
CONFIGURED = PlaceOptions(48.0, 11.0)


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[Clock]:
    clock = Clock()
    monkeypatch.setattr("firmware.place.time.time", lambda: NOW + clock.now - 100.0)
    return clock


@pytest.fixture
def place(clock: Clock) -> Place:
    return Place(clock, CONFIGURED)


def test_without_a_receiver_it_is_the_configured_position(place: Place) -> None:
    ego = place.ego()
    assert (ego.position, ego.is_known, ego.speed) == (Position(480_000_000, 110_000_000), True, 0)
    assert ego.its_ms == its_time_ms(NOW, 5)
    assert place.status()["source"] == "configured"


def test_without_either_it_is_unknown(clock: Clock) -> None:
    place = Place(clock, None)
    assert not place.ego().is_known
    assert (place.status()["source"], place.status()["latitude"]) == ("", None)


def test_a_fix_gives_position_speed_and_heading_in_the_units_of_a_position_vector(place: Place) -> None:
    place.fix("gnss", INGOLSTADT)
    ego = place.ego()
    assert ego.position == Position(487_668_616, 114_320_680)
    assert (ego.is_known, ego.speed, ego.heading) == (True, 1389, 451)


def test_the_time_of_a_position_is_that_of_its_fix(place: Place, clock: Clock) -> None:
    place.fix("gnss", INGOLSTADT)
    clock.now += 0.8
    assert place.ego().its_ms == its_time_ms(NOW, 5)


def test_what_a_receiver_does_not_know_is_nothing(place: Place) -> None:
    place.fix("gnss", Fix(100.0, FixKind.FULL, 487_668_616, 114_320_680))
    assert (place.ego().speed, place.ego().heading, place.ego().is_known) == (0, 0, True)


@pytest.mark.parametrize("heading", [35_999_999, 36_000_000])
def test_a_heading_is_below_a_whole_turn(place: Place, heading: int) -> None:
    place.fix("gnss", INGOLSTADT._replace(heading=heading))
    assert place.ego().heading == 0


def test_an_old_fix_is_none(place: Place, clock: Clock) -> None:
    place.fix("gnss", INGOLSTADT)
    clock.now += FRESH_S + 0.1
    assert place.ego().position == Position(480_000_000, 110_000_000)
    assert place.status()["source"] == "configured"


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
def test_a_fix_that_says_nothing_certain_is_not_used(place: Place, wrong: dict[str, object]) -> None:
    place.fix("gnss", INGOLSTADT._replace(**wrong))
    assert place.status()["source"] == "configured"


def test_of_two_receivers_the_more_certain_is_used_while_it_is_fresh(place: Place, clock: Clock) -> None:
    place.fix("modem", INGOLSTADT._replace(horizontal=5_000))
    place.fix("gnss", INGOLSTADT._replace(horizontal=20))
    assert place.status()["source"] == "gnss"
    place.fix("modem", INGOLSTADT._replace(horizontal=5_000, monotonic=101.0))
    assert place.status()["source"] == "gnss"
    clock.now = 100.0 + FRESH_S + 0.5
    place.fix("modem", INGOLSTADT._replace(horizontal=5_000, monotonic=clock.now))
    assert place.status()["source"] == "modem"


def test_before_the_clock_is_set_the_position_counts_as_unknown(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    place.fix("gnss", INGOLSTADT)
    for utc_s in (12.0, EPOCH - 1.0):
        monkeypatch.setattr("firmware.place.time.time", lambda utc_s=utc_s: utc_s)
        assert (place.ego().its_ms, place.ego().is_known) == (0, False)


def test_the_status_is_in_degrees_metres_and_seconds(place: Place, clock: Clock) -> None:
    place.fix("gnss", INGOLSTADT)
    place.time_mark("gnss", TimeMark(100.0, 1_795_182_427, 25, -312, True, 18))
    clock.now += 0.5
    assert json.loads(json.dumps(place.status())) == {
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
        },
    }
