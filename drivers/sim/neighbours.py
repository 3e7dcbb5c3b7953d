"""Stations in the neighbourhood: CAMs and DENMs as real GeoNetworking frames in UDP datagrams."""

import math
import socket
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated

from board.address import Address, address
from board.describe import Range
from board.errors import InterfaceError
from board.free_udp import free_udp
from board.loop import Loop, Timer
from board.time import leap_seconds, nearest_its_time_ms
from drivers.message import ITS_HEADER, Area, Ego, MessageType, Position, Request, Shape
from drivers.sim.messages import cam, denm
from drivers.wire import frame
from drivers.wire.geonet import GeoNetworking, Heard, Received

CAM = MessageType("cam", 2, 2001, 0, 0)
DENM = MessageType("denm", 1, 2002, 0, 0, traffic_class=1)

FIRST_STATION = 4711
RADIUS = 5000  # metres around a station that its DENMs are for: more than the 3.2 km of the widest circle
METRE = 90  # of latitude, in 1e-7 degree
BATCH = 64  # datagrams heard in one turn


@dataclass(frozen=True)
class NeighboursOptions:
    """Simulated stations.

    listen     address and port that they hear at: a peer of the station under test. A port of 0 is any that is free.
    to         address and port that they send to.
    count      stations; they have the numbers from 4711 on.
    cam_hz     CAMs per second of each. denm_hz: DENMs per second of each; 0 for none.
    latitude   of the middle of their circles, in degrees, WGS84. longitude: likewise.
    """

    listen: str = "127.0.0.1:8949"
    to: str = "127.0.0.1:8947"
    count: Annotated[int, Range(1, 200)] = 2
    cam_hz: Annotated[float, Range(0.01, 1000.0)] = 10.0
    denm_hz: Annotated[float, Range(0.0, 1000.0)] = 1.0
    latitude: Annotated[float, Range(-89.0, 89.0)] = 48.7668616
    longitude: Annotated[float, Range(-179.0, 179.0)] = 11.432068

    def __post_init__(self) -> None:
        for text in (self.listen, self.to):
            address(text)


def with_ports(options: NeighboursOptions) -> NeighboursOptions:
    """The same with a port that nobody has now in place of each 0: any number of stations may have such neighbours."""
    found: list[Address] = []
    for place in (address(options.listen), address(options.to)):
        found.append(place if place.port else next(one for one in free_udp(place.host, 2) if one not in found))
    listen, to = map(str, found)
    return replace(options, listen=listen, to=to)


class Neighbour:
    """One station: it drives in a circle of its own and numbers its DENMs."""

    def __init__(self, number: int, options: NeighboursOptions) -> None:
        self.station_id = FIRST_STATION + number
        self.mac = bytes.fromhex("02aa0000") + self.station_id.to_bytes(2)
        self._core = GeoNetworking(self.mac, beacon_s=0.0)
        self._number = number
        self._middle = Position(round(options.latitude * 1e7), round(options.longitude * 1e7))
        self._events = 0

    def cam(self, now: float, its_ms: int) -> bytes:
        """A frame with a CAM."""
        ego = self._ego(now, its_ms)
        return self._frame(CAM, cam(self.station_id, its_ms, ego.position), now, ego)

    def denm(self, now: float, its_ms: int) -> bytes:
        """A frame with a DENM about a new event, for all around it."""
        self._events += 1
        ego = self._ego(now, its_ms)
        pdu = denm(self.station_id, its_ms, ego.position, self._events)
        return self._frame(DENM, pdu, now, ego, Area(Shape.CIRCLE, ego.position, RADIUS))

    def _ego(self, now: float, its_ms: int) -> Ego:
        """Once around in 40 s: 400 m at 36 km/h for the first station, wider and faster for each further one."""
        radius = 64 * METRE * (1 + self._number / 4)
        angle = math.tau * (now / 40 + self._number / 7)
        east = radius * math.sin(angle) / math.cos(math.radians(self._middle.latitude / 1e7))
        latitude, longitude = self._middle
        position = Position(latitude + round(radius * math.cos(angle)), longitude + round(east))
        heading = round(math.degrees(angle + math.pi / 2) * 10) % 3600
        return Ego(its_ms, position, is_known=True, speed=round(1000 * (1 + self._number / 4)), heading=heading)

    def _frame(self, kind: MessageType, pdu: bytes, now: float, ego: Ego, area: Area | None = None) -> bytes:
        port = kind.btp_port or 0
        request = Request(0, kind, pdu, port, now, now + 60, kind.priority, kind.traffic_class, area)
        return frame.wrap(self.mac, self._core.encode(request, now, ego))


class Beat:
    """A call made again and again, without drift; what a busy loop missed is left out."""

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


class Neighbours:
    """All of them, behind one socket: their air.

    sent, heard  messages by messageID.
    missed       frames that they heard and that held no message for them.
    unsent       frames that the socket did not take.
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
        self._ear = GeoNetworking(bytes.fromhex("02aa0000ffff"), beacon_s=0.0)
        self._socket: socket.socket | None = None
        self._beats: list[Beat] = []

    @property
    def address(self) -> str:
        """Where they hear, once started: port 0 of the option is another one here."""
        assert self._socket is not None
        return "{}:{}".format(*self._socket.getsockname())

    def start(self) -> None:
        """Hear and send from now on. Raises InterfaceError when the address is taken or not ours."""
        air = socket.socket(socket.AF_INET, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK)
        try:
            air.bind(address(self._options.listen))
        except OSError as error:
            air.close()
            hint = "give neighbours.listen in the board file another port, or 0 for any that is free"
            raise InterfaceError(f"simulated neighbours at {self._options.listen}: {error.strerror}", hint) from error
        self._socket = air
        self._loop.add(self)
        for number in range(self._options.count):
            self._begin(Neighbour(number, self._options), number / self._options.count)

    def stop(self) -> None:
        """Fall silent and hear no more; idempotent."""
        for beat in self._beats:
            beat.stop()
        self._beats = []
        if self._socket is not None:
            self._loop.remove(self)
            self._socket.close()
            self._socket = None

    def fileno(self) -> int:
        assert self._socket is not None
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        assert self._socket is not None
        for _ in range(BATCH):
            try:
                octets = self._socket.recv(2048)
            except BlockingIOError:
                return
            self._hear(octets)

    def _begin(self, neighbour: Neighbour, phase: float) -> None:
        sends = ((self._options.cam_hz, CAM, neighbour.cam), (self._options.denm_hz, DENM, neighbour.denm))
        for rate, kind, make in sends:
            if rate > 0:
                beat = Beat(self._loop, 1 / rate, partial(self._send, kind.number, make))
                beat.start(phase / rate)
                self._beats.append(beat)

    def _send(self, number: int, make: Callable[[float, int], bytes]) -> None:
        assert self._socket is not None
        try:
            self._socket.sendto(make(self._loop.clock(), self._its_ms()), self._to)
        except OSError:
            self.unsent += 1
        else:
            self.sent[number] += 1

    def _hear(self, octets: bytes) -> None:
        ethernet = frame.unwrap(octets)
        if isinstance(ethernet, frame.Ethernet):
            nowhere = Ego(self._its_ms(), Position(), is_known=False)
            event = self._ear.receive(ethernet.packet, ethernet.source, self._loop.clock(), nowhere)
            if isinstance(event, Received) and len(event.pdu) >= ITS_HEADER:
                self.heard[event.pdu[1]] += 1
                return
            if isinstance(event, Heard):
                return
        self.missed += 1

    def _its_ms(self) -> int:
        utc_s = self._wall()  # a clock that was never set, or is set beyond 2143, has no ITS time
        return nearest_its_time_ms(utc_s, leap_seconds(utc_s))
