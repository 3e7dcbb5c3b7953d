"""The small end with real brokers, for a moment: nothing is lost, and every tile and vehicle has what was computed."""

from pathlib import Path

import pytest

from tests.proof.fleet.carried import carried
from tests.proof.fleet.load import Fleet, Load
from tests.proof.fleet.measured import BUDGET, MOST_VEHICLES, chosen, measure
from tests.proof.fleet.region import traffic
from tests.proof.fleet.two_brokers import EAST, WEST, bridge_topics, owner

FLEET = Fleet(traffic(1))
SHORT_S = 0.5
TILES = str(Path(__file__).with_name("tiles.toml"))


@pytest.mark.parametrize("name", ["vcaptain", "raw", "orange", TILES])
def test_what_is_published_at_two_bridged_brokers_is_heard_as_computed(name: str) -> None:
    result = measure(FLEET, carried(name), SHORT_S, seed=1, budget=1500.0, has_counts=False)
    assert result.heard == result.expected > 0
    if name == "orange":
        assert sum(result.tapped) == result.published
    elif name == TILES:
        assert sum(result.tapped) > result.published  # what comes over the bridge stands on the same topic
    else:
        assert sum(result.tapped) == 2 * result.published  # each broker has all, by its bridge
    # In half a second each row is off by a message or so of each vehicle.
    assert all(abs(row.difference) < 0.3 for row in result.rows if row.computed * SHORT_S > 50)


@pytest.mark.parametrize("name", ["vcaptain", "raw", "orange", "nap"])
def test_the_vehicles_are_as_many_as_one_process_can_be_and_on_both_sides(name: str) -> None:
    load = chosen(FLEET, carried(name), BUDGET)
    assert load.delivered.messages <= BUDGET
    assert load.fleet.size <= MOST_VEHICLES
    assert {owner(place) for place in load.fleet.places} == {WEST, EAST}


@pytest.mark.parametrize(("name", "least"), [("orange", 50), (TILES, 100)])  # the JSON of a CPM has 9 kB
def test_with_tiles_there_are_many_and_only_the_edge_is_bridged(name: str, least: int) -> None:
    one = carried(name)
    load = chosen(FLEET, one, BUDGET)
    assert load.fleet.size >= least
    lines = bridge_topics(one, load)
    assert 0 < len(lines) < len(load.fleet.places) / 4
    assert {line.split()[1] for line in lines} == {"out", "in"}


def test_a_smaller_fleet_hears_less() -> None:
    one = carried("raw")
    assert Load(FLEET.part(range(50)), one).heard.mean < Load(FLEET.part(range(100)), one).heard.mean
