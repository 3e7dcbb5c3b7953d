"""Simulated neighbour stations: CAMs and DENMs in real GeoNetworking frames, in UDP datagrams."""

import math
import socket
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial

from board.runtime.address import Address, address
from board.runtime.errors import InterfaceError
from board.runtime.free_udp import free_udp
from board.runtime.loop import Loop, Timer
from board.time.scales import nearest_its_time_ms
from drivers.message import ITS_HEADER, Area, Ego, MessageType, Position, Request, Shape
from drivers.sim.circle import Circle
from drivers.sim.messages import TRACE, cam, denm
from drivers.sim.options import NeighboursOptions
from drivers.sim.track import Motion, Point
from drivers.wire import frame
from drivers.wire.geonet.protocol import GeoNetworking, Heard, Mib, Received

CAM = MessageType("cam", 2, 2001, 0, 0)
DENM = MessageType("denm", 1, 2002, 0, 0, traffic_class=1)

FIRST_STATION = 4711
PASSENGER_CAR = 5  # StationType of TS 102 894-2, as in the CAM
LATERAL = 0.5  # m/s^2; a bend of a road at a comfortable speed
ALTITUDE_M = 420.0
AREA_M = 5000  # radius of the area of a DENM, above the diameter of the widest circle, 4.4 km
BATCH = 64  # datagrams received per turn of the loop


def with_ports(options: NeighboursOptions) -> NeighboursOptions:
    """Replace each port 0 by a free port, so that any number of stations can have such neighbours."""
    found: list[Address] = []
    for place in (address(options.listen), address(options.to)):
        found.append(place if place.port else next(one for one in free_udp(place.host, 2) if one not in found))
    listen, to = map(str, found)
    return replace(options, listen=listen, to=to)


class Neighbour:
    """Simulated station, which drives in a circle of its own and numbers its DENMs.

    The first station drives at 36 km/h on a radius of 200 m. Each further radius is 10 m longer, and the speed rises
    so that the lateral acceleration stays at LATERAL: the 200th station drives at 119 km/h.
    """

    def __init__(self, number: int, options: NeighboursOptions) -> None:
        self.station_id = FIRST_STATION + number
        self.mac = bytes.fromhex("02aa0000") + self.station_id.to_bytes(2)
        self._core = GeoNetworking(self.mac, Mib(beacon_s=0.0, station_type=PASSENGER_CAR))
        radius_m = 200.0 + 10 * number
        centre = Point(options.latitude, options.longitude, ALTITUDE_M)
        self._path = Circle(centre, radius_m, math.sqrt(LATERAL * radius_m), math.tau * number / 7)
        self._events = 0

    def cam(self, now: float, its_ms: int) -> bytes:
        """Return a frame with a CAM."""
        motion = self._path.at(now)
        return self._frame(CAM, cam(self.station_id, its_ms, motion), now, _ego(its_ms, motion))

    def denm(self, now: float, its_ms: int) -> bytes:
        """Return a frame with a DENM about a new event at the own position, for all stations around it."""
        self._events += 1
        path = self._path.before(now, TRACE)
        ego = _ego(its_ms, path[0])
        pdu = denm(self.station_id, its_ms, path, self._events)
        return self._frame(DENM, pdu, now, ego, Area(Shape.CIRCLE, ego.position, AREA_M))

    def _frame(self, kind: MessageType, pdu: bytes, now: float, ego: Ego, area: Area | None = None) -> bytes:
        port = kind.btp_port or 0
        request = Request(0, kind, pdu, port, now, now + 60, kind.priority, kind.traffic_class, area)
        return frame.wrap(self.mac, self._core.encode(request, now, ego))


def _ego(its_ms: int, motion: Motion) -> Ego:
    position = Position(motion.latitude, motion.longitude)
    speed = round(motion.speed_mm_s / 10)
    return Ego(its_ms, position, is_known=True, speed=speed, heading=motion.heading_tenths)


class Beat:
    """Periodic call without drift; periods that a busy loop missed are skipped."""

    def __init__(self, loop: Loop, period: float, call: Callable[[], None]) -> None:
        self._loop = loop
        self._period = period
        self._call = call
        self._next = 0.0
        self._timer: Timer | None = None

    def start(self, delay: float) -> None:
        self._next = self._loop.clock() + delay
        self._timer = self._loop.after(delay, self._beat)

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _beat(self) -> None:
        now = self._loop.clock()
        self._next = max(self._next + self._period, now)
        self._timer = self._loop.after(self._next - now, self._beat)
        self._call()


def _nowhere() -> Ego:
    return Ego(0, Position(), is_known=False)


class _SocketSource:
    """UDP socket of the simulated stations; passes each received datagram to `hear`."""

    def __init__(self, opened: socket.socket, hear: Callable[[bytes], None]) -> None:
        self.socket = opened
        self._hear = hear

    def fileno(self) -> int:
        return self.socket.fileno()

    def ready(self, events: int) -> None:
        for _ in range(BATCH):
            try:
                octets = self.socket.recv(2048)
            except BlockingIOError:
                return
            self._hear(octets)


class Neighbours:
    """All simulated neighbours, with one common socket.

    sent, heard  messages by messageID.
    missed       received frames without a message for the neighbours.
    unsent       frames that the socket refused.
    """

    def __init__(self, loop: Loop, options: NeighboursOptions, wall: Callable[[], float] = time.time) -> None:
        self.sent: Counter[int] = Counter()
        self.heard: Counter[int] = Counter()
        self.missed = 0
        self.unsent = 0
        self._loop = loop
        self._options = options
        self._wall = wall
        self._to = address(options.to)
        self._ear = GeoNetworking(bytes.fromhex("02aa0000ffff"), Mib(beacon_s=0.0))
        self._source: _SocketSource | None = None
        self._beats: list[Beat] = []

    @property
    def address(self) -> str:
        """Address where the neighbours receive, after start(); a port 0 of the option is replaced by the real one."""
        assert self._source is not None
        return "{}:{}".format(*self._source.socket.getsockname())

    def start(self) -> None:
        """Begin to receive and send. Raises InterfaceError if the address is in use or not of this machine."""
        opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            opened.bind(address(self._options.listen))
        except OSError as error:
            opened.close()
            hint = "give neighbours.listen in the board file another port, or 0 for any that is free"
            raise InterfaceError(f"simulated neighbours at {self._options.listen}: {error.strerror}", hint) from error
        self._source = source = _SocketSource(opened, self._hear)
        self._loop.add(source)
        for number in range(self._options.count):
            self._begin(source, Neighbour(number, self._options), number / self._options.count)

    def stop(self) -> None:
        """Stop sending and receiving; idempotent."""
        for beat in self._beats:
            beat.stop()
        self._beats = []
        if self._source is not None:
            self._loop.remove(self._source)
            self._source.socket.close()
            self._source = None

    def _begin(self, source: _SocketSource, neighbour: Neighbour, phase: float) -> None:
        sends = ((self._options.cam_hz, CAM, neighbour.cam), (self._options.denm_hz, DENM, neighbour.denm))
        for rate, kind, make in sends:
            if rate > 0:
                beat = Beat(self._loop, 1 / rate, partial(self._send, source, kind.number, make))
                beat.start(phase / rate)
                self._beats.append(beat)

    def _send(self, source: _SocketSource, number: int, make: Callable[[float, int], bytes]) -> None:
        try:
            source.socket.sendto(make(self._loop.clock(), self._its_ms()), self._to)
        except OSError:
            self.unsent += 1
        else:
            self.sent[number] += 1

    def _hear(self, octets: bytes) -> None:
        ethernet = frame.unwrap(octets)
        if isinstance(ethernet, frame.Ethernet):
            event = self._ear.receive(ethernet.packet, ethernet.source, self._loop.clock(), self._its_ms(), _nowhere)
            if isinstance(event, Received) and len(event.pdu) >= ITS_HEADER:
                self.heard[event.pdu[1]] += 1
                return
            if isinstance(event, Heard):
                return
        self.missed += 1

    def _its_ms(self) -> int:
        return nearest_its_time_ms(self._wall())  # clamped, because an unset clock, or one beyond 2143, has no ITS time
