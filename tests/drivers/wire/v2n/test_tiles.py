"""Profiles with map tiles in topics: publications and subscriptions by place."""

from dataclasses import replace

import pytest

from board.runtime.errors import ConfigurationError, RequestError
from drivers.message import Ego, Position
from drivers.mqtt.profile import load
from drivers.wire.v2n.description import ProfileDescription, PublishRow, SubscribeRow, Tiles
from tests.drivers.wire.v2n.station import HERE, NOW_MS, NOWHERE, PDU, delivered, profile
from tests.said import tells

TILED = ProfileDescription(
    name="tiled",
    publish=(PublishRow("t/{type}/{quadkey}", "binary"),),
    subscribe=(SubscribeRow("t/{type}/{quadkey}/#", "binary"),),
    tiles=Tiles(publish_depth=20, subscribe_depth=17, speeds_m_s=(8.0, 20.0)),
)


def test_subscriptions_by_tile_move_with_the_station():
    station = profile(TILED)
    first = station.subscriptions(HERE)
    assert len(first) == 9
    assert station.subscriptions(HERE) == first
    width = round(360e7 / 2**17)
    east = HERE._replace(position=Position(HERE.position.latitude, HERE.position.longitude + width))
    moved = station.subscriptions(east)
    assert len(moved - first) == len(first - moved) == 3


def test_a_published_tile_is_found_by_the_subscription_of_a_station_near():
    (found,) = profile(TILED).publications("cam", 1, PDU, HERE, NOW_MS)
    tiles = {one.removesuffix("/#").replace("+", "cam") for one, _ in profile(TILED).subscriptions(HERE)}
    assert found.topic.rsplit("/", 3)[0] in tiles
    assert profile(TILED).receive(delivered(found)).pdu == PDU


def speed(metres_a_second: float) -> Ego:
    return HERE._replace(speed=round(metres_a_second * 100))


def depth(found: frozenset[tuple[str, int]]) -> int:
    (levels,) = {topic.count("/") for topic, _ in found}
    return levels - 2


@pytest.mark.parametrize(("now", "levels"), [(0, 17), (7.99, 17), (8, 16), (-8, 16), (19.99, 16), (20, 15), (90, 15)])
def test_tiles_grow_with_the_speed(now: float, levels: int):
    assert depth(profile(TILED).subscriptions(speed(now))) == levels


def test_tiles_shrink_only_well_below_the_speed_at_which_they_grew():
    station = profile(TILED)
    speeds = [7.0, 8.1, 7.9, 7.3, 7.1, 7.9, 25.0, 18.1, 17.9, 0.0]
    assert [depth(station.subscriptions(speed(one))) for one in speeds] == [17, 16, 16, 16, 17, 17, 15, 15, 16, 17]


def test_without_a_position_nothing_is_published_by_tile_and_it_says_why():
    with pytest.raises(RequestError, match="the position is not known") as refused:
        profile(TILED).publications("cam", 1, PDU, NOWHERE, NOW_MS)
    assert "tiles.fallback" in refused.value.hint


def test_rows_that_are_not_by_tile_without_a_position_publish_and_the_link_is_up():
    rows = (*TILED.publish, PublishRow("all/{type}", "binary"))
    station = profile(replace(TILED, publish=rows))
    (found,) = station.publications("cam", 1, PDU, NOWHERE, NOW_MS)
    assert found.topic == "all/cam"
    assert tells(station.missing, "profile tiled ", "tile", "position")
    is_all, why = station.lacks(NOWHERE)
    assert not is_all
    assert tells(why, "no position: ", "published", "subscribed")
    assert len(station.publications("cam", 1, PDU, HERE, NOW_MS)) == 2
    assert station.missing == ""


def test_profile_by_tile_without_a_position_names_what_is_not_done():
    station = profile(TILED)
    assert station.lacks(HERE) == (False, "")
    is_all, why = station.lacks(NOWHERE)
    assert is_all
    assert tells(why, "no position: ", "published", "subscribed")
    station.subscriptions(HERE)
    is_all, why = station.lacks(NOWHERE)
    assert is_all
    assert tells(why, "no position: ", "published")
    assert "subscribed" not in why


def test_profile_that_publishes_without_tiles_or_has_a_fallback_needs_no_position_for_that():
    untiled = (PublishRow("t/{type}", "binary"),)
    station = profile(replace(TILED, publish=untiled))
    is_all, why = station.lacks(NOWHERE)
    assert not is_all
    assert tells(why, "no position: ", "subscribed")
    assert "published" not in why
    assert profile(replace(TILED, tiles=Tiles(fallback="12022230212021302"))).lacks(NOWHERE) == (False, "")
    assert profile("raw").lacks(NOWHERE) == (False, "")


def test_a_station_that_was_never_anywhere_asks_for_no_tile():
    assert profile(TILED).subscriptions(NOWHERE) == frozenset()


def test_in_a_tunnel_the_subscriptions_stay():
    station = profile(TILED)
    before = station.subscriptions(HERE)
    assert station.subscriptions(NOWHERE) == before


def test_a_fallback_is_where_a_station_without_a_position_is():
    tiles = Tiles(publish_depth=4, subscribe_depth=3, fallback="120222")
    description = ProfileDescription("f", TILED.publish, TILED.subscribe, tiles=tiles)
    (found,) = profile(description).publications("cam", 1, PDU, NOWHERE, NOW_MS)
    assert found.topic == "t/cam/1/2/0/2"
    assert ("t/+/1/2/0/#", 1) in profile(description).subscriptions(NOWHERE)


def test_depths_of_the_interface_bound_both():
    station = profile(load("orange").adapted(depths=(16, 18)))
    assert {topic.count("/") for topic, _ in station.subscriptions(speed(30))} == {16 + 5}
    (found,) = station.publications("cam", 1, PDU, HERE, NOW_MS)
    assert found.topic.count("/") == 18 + 4


@pytest.mark.parametrize(
    ("depths", "words"),
    [
        ((10, 14), r"depths \[10, 14\]: most: 14 is smaller than subscribe_depth, 17"),
        ((23, 24), r"depths \[23, 24\]: least: 23 is larger than publish_depth, 22"),
    ],
)
def test_depths_by_which_others_are_not_found_are_refused(depths: tuple[int, int], words: str):
    with pytest.raises(ConfigurationError, match=words):
        load("orange").adapted(depths=depths)


@pytest.mark.parametrize(
    "wrong",
    [
        {"publish_depth": 16, "subscribe_depth": 17},
        {"most": 16},
        {"least": 23},
        {"fallback": "120221"},
        {"publish_depth": 31},
        {"subscribe_depth": 0},
        {"speeds_m_s": (20.0, 8.0)},
        {"speeds_m_s": (-1.0,)},
        {"least": 9, "most": 8},
        {"fallback": "12a"},
    ],
)
def test_tiles_that_cannot_be_are_a_mistake(wrong: dict[str, object]):
    with pytest.raises(ConfigurationError):
        Tiles(**wrong)  # type: ignore[arg-type]
