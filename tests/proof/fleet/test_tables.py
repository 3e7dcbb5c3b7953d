"""The tables of `make fleet` explain their words."""

from drivers.mqtt.profile import names
from tests.proof.fleet.__main__ import PROFILES, TILES, computed, foreign
from tests.proof.fleet.carried import carried
from tests.proof.fleet.limits import BROKER_RATE, DOWNLINK_BITS, Limits
from tests.proof.fleet.load import Fleet
from tests.proof.fleet.region import traffic


def test_the_words_of_each_table_are_explained_below_it():
    loads = [carried(str(TILES))]
    tables = list(computed(Fleet(traffic(1, 500)), loads, [500], Limits(DOWNLINK_BITS, BROKER_RATE), ["a remark"]))
    notes = [" ".join(table.notes) for table in tables]
    assert notes[0].endswith("a remark")
    for word in ("entered/s:", "downlink:"):
        assert word in notes[1]
    for word in ("cut:", "bridges:", "unheard:"):
        assert word in notes[2]


def test_a_profile_that_captain_does_not_bring_is_said_to_be_of_a_file():
    said = list(foreign(PROFILES, [carried(name) for name in PROFILES]))
    assert len(said) == 1
    assert said[0].startswith("tiles: of ")
    assert "tiles.toml" in said[0]
    assert "tiles" not in names()
