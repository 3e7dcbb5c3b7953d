"""The handlers: what each says of its messages is so in the message library."""

import captain_messages
import pytest

from firmware.gateway.captain_gateway.captain_gateway.handlers import KINDS
from tests.firmware.gateway.real import CAM, DENM, IVIM, MAPEM, SPATEM

REAL = {"cam": CAM, "denm": DENM, "mapem": MAPEM, "spatem": SPATEM, "ivim": IVIM}


def known(edition: str, path: str) -> bool:
    try:
        captain_messages.find(edition).reader(path)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("kind", KINDS.values(), ids=list(KINDS))
def test_every_edition_that_a_handler_names_is_one_and_carries_the_same_message(kind):
    found = [captain_messages.find(name) for name in kind.editions]
    assert [message.name for message in found] == list(kind.editions)
    assert len({message.type for message in found}) == 1


@pytest.mark.parametrize("kind", KINDS.values(), ids=list(KINDS))
def test_every_path_that_a_handler_names_is_there_in_one_of_its_editions(kind):
    paths = [path for pair in kind.position for path in pair] + [*kind.generated, *kind.key]
    assert [path for path in paths if not any(known(name, path) for name in kind.editions)] == []


@pytest.mark.parametrize("kind", KINDS.values(), ids=list(KINDS))
def test_a_handler_that_says_where_or_when_says_it_in_each_of_its_editions(kind):
    for name in kind.editions if kind.name != "vam" else kind.editions[:2]:
        assert not kind.position or any(known(name, pair[0]) and known(name, pair[1]) for pair in kind.position)
        assert not kind.generated or any(known(name, path) for path in kind.generated)
        assert (kind.clock == "none") is not bool(kind.generated)


@pytest.mark.parametrize("name", REAL)
def test_what_is_one_and_the_same_thing_can_be_read_of_a_real_message(name):
    kind = KINDS[name]
    paths = [path for path in kind.key if known(kind.editions[0], path)]
    if paths:
        assert None not in captain_messages.find(kind.editions[0]).reader(*paths)(REAL[name])[-1:]


def test_every_type_that_the_station_has_a_name_for_has_a_handler():
    carried = {captain_messages.find(kind.editions[0]).type for kind in KINDS.values()}
    assert {message.type for message in captain_messages.all()} - carried == {"rawrx", "rawtx"}
