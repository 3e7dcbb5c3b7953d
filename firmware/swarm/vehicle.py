"""Virtual station: drives along its track, generates messages and frames."""

from collections import deque
from dataclasses import dataclass
from math import cos, hypot, radians, sin, tau
from random import Random

from drivers.message import Area, Ego, MessageType, Position, Request, Shape
from drivers.sim.track import METRES, Motion, Track
from drivers.wire import frame
from drivers.wire.geonet.protocol import GeoNetworking, Mib
from firmware.swarm.generation import Generation
from firmware.swarm.messages import Past, Writer

PATH_POINT_M = 25.0  # distance between two points of a path history
PATH_POINTS = 8
LIFETIME_S = 60.0
HOPS = 5
AREA_M = 500  # radius of the area that is warned of an event


@dataclass(frozen=True)
class Style:
    """Driving style of a vehicle.

    speed     mean speed in m/s.
    swing     amplitude of the speed in m/s.
    period_s  seconds of one oscillation of the speed.
    start_m   start along the track in metres.
    """

    speed: float
    swing: float
    period_s: float
    start_m: float


def style(chance: Random, speed: float, length_m: float) -> Style:
    """Return a random driving style; speed: mean of all vehicles in m/s."""
    mean = speed * chance.uniform(0.8, 1.2)
    return Style(mean, mean * chance.uniform(0.1, 0.6), chance.uniform(15, 60), chance.uniform(0, length_m))


class Vehicle:
    """Virtual station. Times are seconds of the swarm's clock; its_ms is ITS time in ms."""

    def __init__(self, number: int, station_id: int, track: Track, style: Style, writer: Writer) -> None:
        self.number = number
        self.station_id = station_id
        self.mac = b"\x02\x5a" + station_id.to_bytes(4)
        self.generation = Generation()
        self.motion = track.at(style.start_m)
        self.is_moved_at = -1.0
        self._track = track  # its speed is 1 m/s, so that times given to it are metres
        self._style = style
        self._writer = writer
        self._acceleration = 0.0
        self._past: deque[Past] = deque(maxlen=PATH_POINTS)
        self._core = GeoNetworking(self.mac, Mib(beacon_s=0.0, station_type=5))

    def move(self, now: float) -> Motion:
        """Move the vehicle to where it is at a time, and return its motion there."""
        if now != self.is_moved_at:
            speed, swing, period = self._style.speed, self._style.swing, self._style.period_s / tau
            way = speed * now + swing * period * (1 - cos(now / period))
            self._acceleration = swing / period * cos(now / period)
            velocity = round((speed + swing * sin(now / period)) * 1000)
            self.motion = self._track.at(self._style.start_m + way)._replace(speed_mm_s=velocity)
            self.is_moved_at = now
        return self.motion

    def cam(self, now: float, its_ms: int) -> bytes:
        motion = self.move(now)
        low = self.generation.has_low_frequency(now)
        pdu = self._writer.cam(self.station_id, its_ms, motion, self._acceleration, [*self._past] if low else None)
        if low and (not self._past or distance_m(self._past[0].motion, motion) >= PATH_POINT_M):
            self._past.appendleft(Past(its_ms, motion))
        return pdu

    def frame(self, kind: MessageType, pdu: bytes, now: float, its_ms: int, area: Area | None = None) -> bytes:
        """Return the Ethernet frame of a message: single hop, or a GeoBroadcast to an area."""
        position = Position(self.motion.latitude, self.motion.longitude)
        heading = self.motion.heading // 10_000 % 3600
        ego = Ego(its_ms, position, is_known=True, speed=self.motion.speed_mm_s // 10, heading=heading)
        port, until = kind.btp_port or 0, now + LIFETIME_S
        request = Request(0, kind, pdu, port, now, until, kind.priority, kind.traffic_class, area, HOPS)
        return frame.wrap(self.mac, self._core.encode(request, now, ego))


def area_around(motion: Motion) -> Area:
    return Area(Shape.CIRCLE, Position(motion.latitude, motion.longitude), AREA_M)


def distance_m(one: Motion, other: Motion) -> float:
    north = (other.latitude - one.latitude) * 1e-7 * METRES
    return hypot(north, (other.longitude - one.longitude) * 1e-7 * METRES * cos(radians(one.latitude * 1e-7)))
