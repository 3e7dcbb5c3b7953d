"""The verdict of `make attack`, for each thing that a station must hold."""

import pytest

from tests.attack.__main__ import FULL_S, MEMORY_ALL_KB, MEMORY_KB, Lags, Phase, faults

QUIET = Phase(Lags([0.001] * 100), Lags([0.001] * 100), 100, 100, 100, 30_000)
SLOWER = QUIET._replace(loop=Lags([0.0031] * 100))
ONE_LONG = Lags([0.001] * 199 + [1.0])


def test_a_station_that_holds_all_has_no_fault() -> None:
    assert faults(QUIET, QUIET, True, True, 9, FULL_S) == []


@pytest.mark.parametrize(
    ("attacked", "is_alive", "is_released", "attacks", "told"),
    [
        (QUIET, False, True, 9, "the station ended"),
        (QUIET, True, False, 9, "descriptors were not released"),
        (QUIET._replace(received=99), True, True, 9, "the good client lost messages"),
        (QUIET._replace(raw=99), True, True, 9, "the good client lost messages"),
        (QUIET._replace(messages=ONE_LONG), True, True, 9, "a message took 1000 ms"),
        (QUIET._replace(loop=ONE_LONG), True, True, 9, "the loop took 1000 ms"),
        (QUIET._replace(memory_kb=30_000 + MEMORY_KB + 1024), True, True, 1, "memory grew by 65 MB; at most 64"),
        (QUIET._replace(memory_kb=30_000 + MEMORY_ALL_KB + 1024), True, True, 9, "memory grew by 161 MB; at most 160"),
        (SLOWER, True, True, 9, "the loop's lag p99 grew 3.10 times; at most 3"),
    ],
)
def test_each_fault_is_told_and_fails(
    attacked: Phase, is_alive: bool, is_released: bool, attacks: int, told: str
) -> None:
    assert faults(QUIET, attacked, is_alive, is_released, attacks, FULL_S) == [told]


def test_the_ratio_of_a_short_run_is_no_fault() -> None:
    assert faults(QUIET, SLOWER, True, True, 9, 10.0) == []
