"""Function F of EN 302 931: inside, outside and on the border of every shape, turned ones too."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.message import Area, Position, Shape
from drivers.wire.area import contains, function_f

CENTRE = Position(487668616, 114320680)
# One metre at 48.77 degrees north in 1e-7 degree: 111 200 m per degree of latitude, 73 490 m per degree of longitude.
NORTH, EAST = 1e7 / 111_200, 1e7 / 73_490


def place(north_m, east_m, centre=CENTRE):
    return Position(round(centre.latitude + north_m * NORTH), round(centre.longitude + east_m * EAST))


CIRCLE = Area(Shape.CIRCLE, CENTRE, 500)
RECTANGLE = Area(Shape.RECTANGLE, CENTRE, 1000, 100)  # 2000 m from south to north, 200 m from west to east
ELLIPSE = Area(Shape.ELLIPSE, CENTRE, 1000, 100)


@pytest.mark.parametrize("area", [CIRCLE, RECTANGLE, ELLIPSE])
def test_f_is_one_in_the_centre(area):
    assert function_f(area, CENTRE) == 1


@pytest.mark.parametrize(
    ("area", "north_m", "east_m", "is_inside"),
    [
        (CIRCLE, 495, 0, True),
        (CIRCLE, 0, -495, True),
        (CIRCLE, 350, 350, True),
        (CIRCLE, 505, 0, False),
        (CIRCLE, 0, 505, False),
        (CIRCLE, 360, 360, False),
        (RECTANGLE, 990, 95, True),
        (RECTANGLE, -990, -95, True),
        (RECTANGLE, 1010, 0, False),
        (RECTANGLE, 0, 105, False),
        (ELLIPSE, 990, 0, True),
        (ELLIPSE, 0, -95, True),
        (ELLIPSE, 700, 70, True),
        (ELLIPSE, 990, 95, False),  # in the rectangle's corner
        (ELLIPSE, 720, 72, False),
        (ELLIPSE, 1010, 0, False),
    ],
)
def test_a_place_is_inside_or_outside(area, north_m, east_m, is_inside):
    assert contains(area, place(north_m, east_m)) == is_inside


@pytest.mark.parametrize("shape", [Shape.RECTANGLE, Shape.ELLIPSE])
@pytest.mark.parametrize(
    ("angle", "north_m", "east_m"),
    [(0, 900, 0), (90, 0, 900), (45, 636, 636), (135, -636, 636), (180, -900, 0), (270, 0, -900), (30, 779, 450)],
)
def test_the_angle_turns_the_long_axis_from_north_to_east(shape, angle, north_m, east_m):
    area = Area(shape, CENTRE, 1000, 100, angle)
    assert contains(area, place(north_m, east_m))
    assert contains(area, place(-north_m, -east_m))
    assert not contains(area, place(-east_m, north_m))  # across it
    assert not contains(area, place(east_m, -north_m))


@pytest.mark.parametrize("angle", [0, 45, 90, 359, 65535])
def test_a_circle_has_neither_angle_nor_second_distance(angle):
    area = Area(Shape.CIRCLE, CENTRE, 500, 1, angle)
    assert contains(area, place(350, 350))
    assert not contains(area, place(0, 510))


@pytest.mark.parametrize(
    "area",
    [
        Area(Shape.CIRCLE, CENTRE, 0, 100),
        Area(Shape.RECTANGLE, CENTRE, 0, 100),
        Area(Shape.RECTANGLE, CENTRE, 100, 0),
        Area(Shape.ELLIPSE, CENTRE, 100, 0),
    ],
)
def test_an_area_without_extent_has_no_inside(area):
    assert not contains(area, CENTRE)
    assert function_f(area, CENTRE) == -math.inf


def test_distances_are_right_on_the_other_side_of_the_date_line():
    area = Area(Shape.CIRCLE, Position(0, 1_799_999_900), 100)
    assert contains(area, Position(0, -1_799_999_900))  # 2.2 m to the east
    assert not contains(area, Position(0, -1_799_000_000))


def test_distances_are_those_of_the_ellipsoid():
    # WGS84: a degree of latitude has 110 574 m at the equator and 111 694 m at the pole; of longitude 111 320 m.
    def reaches(start, end, metres):
        return contains(Area(Shape.CIRCLE, start, metres), end)

    tenth = 1_000_000
    assert reaches(Position(-tenth // 2, 0), Position(tenth // 2, 0), 11058)
    assert not reaches(Position(-tenth // 2, 0), Position(tenth // 2, 0), 11056)
    assert reaches(Position(0, 0), Position(0, tenth), 11133)
    assert not reaches(Position(0, 0), Position(0, tenth), 11131)
    assert reaches(Position(899_000_000, 0), Position(900_000_000, 0), 11170)
    assert not reaches(Position(899_000_000, 0), Position(900_000_000, 0), 11168)


numbers_32 = st.integers(-(2**31), 2**31 - 1)
numbers_16 = st.integers(0, 65535)
positions = st.builds(Position, numbers_32, numbers_32)
areas = st.builds(Area, st.sampled_from(Shape), positions, numbers_16, numbers_16, numbers_16)


@given(area=areas, position=positions)
@settings(deadline=None, max_examples=500)
def test_no_area_and_no_place_raise(area, position):
    assert contains(area, position) in (True, False)


@given(area=areas, turns=st.integers(0, 100))
@settings(deadline=None, max_examples=100)
def test_full_turns_change_nothing(area, turns):
    position = Position(area.centre.latitude + 1000, area.centre.longitude + 500)
    turned = area._replace(angle=area.angle + 360 * turns)
    assert function_f(area, position) == pytest.approx(function_f(turned, position), rel=1e-6, abs=1e-6)
