"""A region with a hot city and open country, and the traffic of its peak hour: where vehicles are, how they move.

64 km x 64 km: a city of streets every 200 m, a motorway ring with four arms, country roads every 4 km. All traffic of the
region is TRAFFIC vehicles, a tenth of the cars of a million people at once; a fleet is the part of it that has a
station. The same seed gives the same traffic, and a smaller fleet is part of a larger one.
"""

import math
import random
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

TRAFFIC = 100_000

LATITUDE, LONGITUDE = 48.7668616, 11.432068  # of the middle
HALF_KM = 32.0
KM_PER_DEGREE = 40_007.863 / 360  # along a meridian, WGS84

CITY_KM = 6.0  # radius, of the ring too
CITY_SIGMA_KM = 2.2  # of the traffic around the middle
STREETS_KM, ROADS_KM = 0.2, 4.0  # from one to the next
ARMS_KM = 15.0  # after which an arm of the motorway has 1/e of its traffic

CELL_KM = 0.5  # speeds follow the traffic in squares of this size
JAM_PER_KM = 150.0  # vehicles of 6.7 m, bumper to bumper, on a lane
SLOWEST = 1.0  # m/s, where a jam still moves


class Kind(NamedTuple):
    """A kind of road.

    share      of the traffic.
    free_speed  m/s on an empty road.
    lane_km    of lanes in a cell through which such roads go.
    standing, accelerating, turning  shares of the vehicles there that do so.
    acceleration  m/s2, yaw  degrees/s: least and most of those that do.
    """

    name: str
    share: float
    free_speed: float
    lane_km: float
    standing: float
    accelerating: float
    acceleration: tuple[float, float]
    turning: float
    yaw: tuple[float, float]


# Shares and manners are assumptions of this simulation, chosen by hand; lanes follow from the geometry above.
CITY = Kind("city", 0.48, 13.9, 5.0, 0.25, 0.35, (0.5, 2.5), 0.08, (10.0, 25.0))
MOTORWAY = Kind("motorway", 0.22, 33.3, 3.0, 0.0, 0.10, (0.3, 1.0), 0.03, (0.5, 2.0))
COUNTRY = Kind("country", 0.30, 25.0, 1.0, 0.02, 0.15, (0.3, 1.5), 0.15, (2.0, 6.0))
KINDS = (CITY, MOTORWAY, COUNTRY)


class Vehicle(NamedTuple):
    """x, y in km east and north of the middle; speed in m/s, acceleration in m/s2, yaw in degrees/s.

    around  vehicles on the lanes of 100 m in front and behind, with a station or without.
    """

    x: float
    y: float
    speed: float
    acceleration: float
    yaw: float
    around: float
    kind: Kind

    @property
    def place(self) -> tuple[float, float]:
        """Latitude and longitude in degrees."""
        return degrees(self.x, self.y)


def degrees(x: float, y: float) -> tuple[float, float]:
    """Latitude and longitude of a place in km east and north of the middle."""
    latitude = LATITUDE + y / KM_PER_DEGREE
    return latitude, LONGITUDE + x / (KM_PER_DEGREE * math.cos(math.radians(LATITUDE)))


def traffic(seed: int = 1, count: int = TRAFFIC) -> list[Vehicle]:
    """The traffic of the region, in an order without meaning: the first vehicles are a fleet of that size."""
    dice = random.Random(seed)
    spots = [(kind, *_spot(kind, dice)) for kind in _kinds(dice, count)]
    cells = Counter((kind.name, *_cell(x, y)) for kind, x, y in spots)
    per_cell = TRAFFIC / count
    return [_vehicle(dice, kind, x, y, per_cell * cells[kind.name, *_cell(x, y)]) for kind, x, y in spots]


def _kinds(dice: random.Random, count: int) -> Iterator[Kind]:
    yield from dice.choices(KINDS, [kind.share for kind in KINDS], k=count)


def _spot(kind: Kind, dice: random.Random) -> tuple[float, float]:
    if kind is CITY:
        return _in_city(dice)
    return _on_motorway(dice) if kind is MOTORWAY else _in_country(dice)


def _in_city(dice: random.Random) -> tuple[float, float]:
    while True:
        x, y = dice.gauss(0, CITY_SIGMA_KM), dice.gauss(0, CITY_SIGMA_KM)
        if math.hypot(x, y) < CITY_KM:
            break
    return (_street(x), y) if dice.random() < 0.5 else (x, _street(y))


def _street(at: float) -> float:
    return round(at / STREETS_KM) * STREETS_KM


def _on_motorway(dice: random.Random) -> tuple[float, float]:
    if dice.random() < 0.3:  # the ring, and a fifth of that in one jam
        angle = dice.uniform(0, 0.3) if dice.random() < 0.2 else dice.uniform(0, 2 * math.pi)
        return CITY_KM * math.cos(angle), CITY_KM * math.sin(angle)
    while (along := CITY_KM + dice.expovariate(1 / ARMS_KM)) > HALF_KM:
        pass
    return dice.choice(((along, 0.0), (-along, 0.0), (0.0, along), (0.0, -along)))


def _in_country(dice: random.Random) -> tuple[float, float]:
    road = dice.randint(-7, 7) * ROADS_KM
    along = dice.uniform(-HALF_KM, HALF_KM)
    return (road, along) if dice.random() < 0.5 else (along, road)


def _cell(x: float, y: float) -> tuple[int, int]:
    return math.floor(x / CELL_KM), math.floor(y / CELL_KM)


def _vehicle(dice: random.Random, kind: Kind, x: float, y: float, in_cell: float) -> Vehicle:
    """Speed falls with density in a straight line (Greenshields 1935), and is a little different for everybody."""
    per_km = in_cell / kind.lane_km
    mean = max(SLOWEST, kind.free_speed * (1 - per_km / JAM_PER_KM))
    around = 0.2 * per_km * (2 if kind is not MOTORWAY else 6)
    if dice.random() < kind.standing:
        return Vehicle(x, y, 0.0, 0.0, 0.0, around, kind)
    speed = max(0.0, dice.gauss(mean, 0.15 * mean))
    acceleration = dice.uniform(*kind.acceleration) if dice.random() < kind.accelerating else 0.0
    yaw = dice.uniform(*kind.yaw) if dice.random() < kind.turning else 0.0
    return Vehicle(x, y, speed, acceleration, yaw, around, kind)
