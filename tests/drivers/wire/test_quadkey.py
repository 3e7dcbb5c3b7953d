"""Tiles of the map, compared with mercantile, an independent implementation."""

import mercantile
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from drivers.message import Position
from drivers.wire.quadkey import MAX_DEPTH, Tile, follow, from_digits, tile

INGOLSTADT = Position(487668616, 114320680)
GRAZ = Position(470_707_000, 154_395_000)

# Positions up to 85 degrees: beyond 85.05 degrees, mercantile raises an error or clips.
positions = st.builds(Position, st.integers(-850_000_000, 850_000_000), st.integers(-1_799_999_999, 1_799_999_999))
depths = st.integers(1, MAX_DEPTH)
tiled_depths = st.integers(1, 22)  # depths at which rounding errors are far below 1e-7 degree


def theirs(position: Position, depth: int) -> mercantile.Tile:
    return mercantile.tile(position.longitude / 1e7, position.latitude / 1e7, depth)


@given(positions, tiled_depths)
@example(GRAZ, 22)
@example(Position(0, 0), 1)
@example(Position(-338_688_000, 1_512_093_000), 17)
def test_a_position_has_the_tile_and_quadkey_of_another_implementation(position: Position, depth: int):
    there = theirs(position, depth)
    assert tile(position, depth) == (there.x, there.y, depth)
    assert tile(position, depth).digits() == mercantile.quadkey(there)


def test_the_quadkey_of_the_published_example():
    # Microsoft, "Bing Maps Tile System": tile x 3, y 5 at level 3 has quadkey 213.
    assert Tile(3, 5, 3).digits() == "213"


@pytest.mark.parametrize("depth", [1, 5, 22, MAX_DEPTH])
def test_the_poles_are_in_the_first_and_the_last_row(depth: int):
    last = (1 << depth) - 1
    for latitude, row in [(900_000_000, 0), (850_600_000, 0), (-850_600_000, last), (-900_000_000, last)]:
        assert tile(Position(latitude, 0), depth).row == row


@pytest.mark.parametrize("depth", [1, 5, 22, MAX_DEPTH])
def test_either_side_of_the_date_line_is_the_first_and_the_last_column(depth: int):
    last = (1 << depth) - 1
    assert tile(Position(0, -1_800_000_000), depth).column == 0
    assert tile(Position(0, 1_799_999_999), depth).column == last
    assert tile(Position(0, 1_800_000_000), depth).column == last


@given(positions, depths)
def test_a_quadkey_begins_with_those_of_the_tiles_that_hold_it(position: Position, depth: int):
    digits = tile(position, MAX_DEPTH).digits()
    assert digits[:depth] == tile(position, depth).digits()
    assert from_digits(digits[:depth]) == tile(position, depth)


@given(positions, st.integers(2, 22))
def test_neighbours_are_those_of_another_implementation_away_from_the_date_line(position: Position, depth: int):
    middle = theirs(position, depth)
    if 0 < middle.x < (1 << depth) - 1:
        around = {(one.x, one.y, one.z) for one in (*mercantile.neighbors(middle), middle)}
        assert set(tile(position, depth).around()) == around


@pytest.mark.parametrize("depth", range(3, 23))
@pytest.mark.parametrize("longitude", [-1_800_000_000, 1_799_999_990])
def test_neighbours_go_on_across_the_date_line(depth: int, longitude: int):
    here = Position(516_000_000, longitude)
    width = 360 / (1 << depth)
    bounds = mercantile.bounds(*theirs(here, depth))
    latitude, middle = here.latitude / 1e7, (bounds.west + bounds.east) / 2
    row = theirs(here, depth).y
    expected = set()
    for step in (-1, 0, 1):
        there = mercantile.tile((middle + step * width + 180) % 360 - 180, latitude, depth)
        expected |= {(there.x, row + up, depth) for up in (-1, 0, 1)}
    assert set(tile(here, depth).around()) == expected
    assert len(expected) == 9
    assert {one[0] for one in expected} >= {0, (1 << depth) - 1}


@pytest.mark.parametrize(("depth", "count"), [(1, 4), (2, 6), (3, 6), (22, 6)])
def test_at_the_edge_of_the_map_there_is_nothing_beyond(depth: int, count: int):
    for latitude in (900_000_000, -900_000_000):
        around = tile(Position(latitude, 10), depth).around()
        assert len(around) == count
        assert all(0 <= one.row < 1 << depth and 0 <= one.column < 1 << depth for one in around)


@pytest.mark.parametrize("digits", ["", "4", "01 2", "0/1", "٣", "0" * (MAX_DEPTH + 1), "-1"])
def test_what_is_no_quadkey_is_refused(digits: str):
    with pytest.raises(ValueError, match="invalid quadkey"):
        from_digits(digits)


def test_the_noise_of_a_position_at_an_edge_does_not_change_the_tile():
    edge = mercantile.bounds(*theirs(INGOLSTADT, 17)).east
    inside = Position(INGOLSTADT.latitude, round(edge * 1e7) - 50)
    outside = inside._replace(longitude=inside.longitude + 100)
    first = tile(inside, 17)
    assert tile(outside, 17) != first
    assert follow(outside, 17, first) == first


def test_a_tenth_of_a_tile_beyond_the_edge_the_tile_changes():
    bounds = mercantile.bounds(*theirs(INGOLSTADT, 17))
    width = round((bounds.east - bounds.west) * 1e7)
    first = tile(INGOLSTADT, 17)
    beyond = Position(INGOLSTADT.latitude, round(bounds.east * 1e7) + round(0.11 * width))
    assert follow(beyond, 17, first) == tile(beyond, 17) != first


def test_another_depth_is_another_tile_at_once():
    assert follow(INGOLSTADT, 16, tile(INGOLSTADT, 17)) == tile(INGOLSTADT, 16)


def test_the_tile_is_kept_across_the_date_line_too():
    first = tile(Position(0, 1_799_999_999), 17)
    assert first.column == (1 << 17) - 1
    assert follow(Position(0, -1_799_999_900), 17, first) == first
    assert follow(Position(0, -1_799_900_000), 17, first).column == 3


@given(positions, depths, positions)
def test_what_is_kept_is_never_far(position: Position, depth: int, before: Position):
    kept = follow(position, depth, tile(before, depth))
    assert tile(position, depth) in kept.around()
