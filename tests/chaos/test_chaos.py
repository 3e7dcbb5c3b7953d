"""Everything fails at random for minutes of virtual time, and a station stays what it is."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.sim.trouble import BOARD
from tests.chaos.stage import INTERFACES, Stage
from tests.chaos.virtual import VirtualRun

# `make chaos` runs 30 minutes of each of many.
MINUTES = float(os.environ.get("CHAOS_MINUTES", "2"))
SEEDS = range(1, 1 + int(os.environ.get("CHAOS_COUNT", "3")))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_station_routes_on_and_brings_every_module_back(seed: int, tmp_path: Path, monkeypatch) -> None:
    run = VirtualRun(seed, MINUTES, tmp_path, monkeypatch)
    try:
        goals = run.play()
    finally:
        run.stage.close()
    assert [f"{goal.what}: {goal.seen}" for goal in goals if not goal.is_met] == []


@pytest.fixture
def stage(tmp_path: Path, monkeypatch) -> Iterator[Stage]:
    stage = Stage(tmp_path, monkeypatch, 1)
    yield stage
    stage.close()


def test_from_power_on_the_time_line_names_what_each_module_waits_for(stage: Stage) -> None:
    stage.start()
    stage.loop.run_until(lambda: all(stage.is_up(name) for name in (*INTERFACES, BOARD)), 30.0)
    told = {(note["who"], str(note["what"]).partition(":")[0]) for note in stage.station.timeline.status()}
    for slot in INTERFACES:
        assert {(f"slot {slot}", word) for word in ("powering", "starting", "running")} <= told
