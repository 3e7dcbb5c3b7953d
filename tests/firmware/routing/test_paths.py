"""Stations and types by the way that their messages come: a bounded number, the least recent forgotten."""

import pytest

from firmware.routing.paths import CAPACITY, SHOWN, Paths
from firmware.topics import Topics


def who(station: int, number: int = 2) -> bytes:
    return bytes((number,)) + station.to_bytes(4)


def alone(paths: Paths, *stations: int, interface: str = "g5") -> None:
    paths.alone([(0.0, 0, interface, who(station)) for station in stations])


@pytest.fixture
def paths() -> Paths:
    return Paths(Topics(), capacity=3)


def stations(paths: Paths) -> list[object]:
    return [row["station"] for row in paths.status()["paths"]]  # type: ignore[attr-defined]


def test_the_least_recent_is_forgotten_and_counted(paths: Paths) -> None:
    alone(paths, 1, 2, 3, 1)
    alone(paths, 4)
    assert (stations(paths), paths.forgotten) == ([1, 3, 4], 1)
    paths.pair(who(3), "g5", 0.01)
    alone(paths, 5)
    assert (stations(paths), paths.forgotten) == ([3, 4, 5], 2)


def test_a_pair_of_one_that_is_not_known_takes_a_place_too(paths: Paths) -> None:
    alone(paths, 1, 2, 3)
    paths.pair(who(4), "g5", 0.01)
    assert (stations(paths), paths.forgotten) == ([2, 3, 4], 1)


def test_each_interface_has_its_own_counts(paths: Paths) -> None:
    alone(paths, 1, 1)
    alone(paths, 1, interface="v2n")
    paths.pair(who(1), "g5", 0.010)
    paths.pair(who(1), "g5", 0.030)
    paths.pair(who(1), "v2n", 0.5)
    assert paths.status()["paths"] == [
        {
            "station": 1,
            "type": "cam",
            "first": {"g5": 2, "v2n": 1},
            "lead_ms": {"g5": 20.0, "v2n": 500.0},
            "alone": {"g5": 2, "v2n": 1},
        }
    ]


def test_a_type_without_a_name_is_counted_like_any_other(paths: Paths) -> None:
    paths.alone([(0.0, 0, "g5", who(1, 250))])
    assert [row["type"] for row in paths.status()["paths"]] == [""]  # type: ignore[attr-defined]


def test_a_status_shows_the_most_recent_ones_and_says_how_many_there_are() -> None:
    paths = Paths(Topics())
    alone(paths, *range(CAPACITY + 5))
    status = paths.status()
    assert stations(paths) == list(range(CAPACITY + 5 - SHOWN, CAPACITY + 5))
    assert (status["paths_kept"], status["paths_forgotten"]) == (CAPACITY, 5)
