"""Sender for all virtual stations; late messages are sent, never omitted."""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from heapq import heappop, heappush
from itertools import count, islice
from random import Random
from typing import Protocol, TypeAlias

from board.time.scales import nearest_its_time_ms
from drivers.message import Area, MessageType
from drivers.sim.track import Motion
from firmware.swarm.generation import CHECK_S
from firmware.swarm.messages import MOST_OBJECTS, REACH_M, Writer
from firmware.swarm.vehicle import Vehicle, area_around, distance_m
from firmware.topics import Topics

REPEAT_S, REPETITIONS = 1.0, 10  # repetitions of a DENM and their interval, before it is cancelled
TYPES = Topics()
CAM, CPM, DENM = (TYPES.by_envelope[b"v2x.%s." % name] for name in (b"cam", b"cpm", b"denm"))


@dataclass
class Event:
    """Event that a vehicle warns of; told: number of DENMs sent so far."""

    vehicle: Vehicle
    sequence: int
    position: Motion
    detected_ms: int
    told: int = 0


class Out(Protocol):
    """Function that sends a message."""

    def __call__(
        self, vehicle: Vehicle, kind: MessageType, pdu: bytes, now: float, its_ms: int, area: Area | None
    ) -> None: ...


@dataclass(frozen=True)
class Plan:
    """Messages to send.

    cam_hz   CAMs per second of each vehicle; None: by the rules of EN 302 637-2.
    cpm_hz   CPMs per second of each vehicle; 0: none.
    denm_hz  new events per second of the whole swarm; 0: none. Each is repeated ten times, a second apart, then
             cancelled.
    seed     seed of all random numbers.
    """

    cam_hz: float | None = None
    cpm_hz: float = 0.0
    denm_hz: float = 0.0
    seed: int = 1


@dataclass
class Sent:
    """Counts of sent messages.

    types     messages by type.
    stations  messages by type and stationID.
    latest_s  longest delay of a message after it was due, in seconds.
    late      messages sent more than LATE_S after they were due.
    seconds   duration so far.
    """

    types: Counter[str]
    stations: Counter[tuple[str, int]]
    latest_s: float = 0.0
    late: int = 0
    seconds: float = 0.0

    @property
    def total(self) -> int:
        return self.types.total()


# Action of the timetable. It receives its due time in seconds after the start, and returns its next one; None: never
# again.
Call: TypeAlias = Callable[[float], float | None]
LATE_S = 0.1


class Swarm:
    """Vehicles and their timetable of messages.

    clock  monotonic time in seconds.
    wall   Unix time in seconds.
    """

    def __init__(
        self,
        vehicles: Sequence[Vehicle],
        plan: Plan,
        writer: Writer,
        out: Out,
        clock: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.sent = Sent(Counter(), Counter())
        self._vehicles = vehicles
        self._plan = plan
        self._writer = writer
        self._out = out
        self._clock = clock
        self._wall = wall
        self._sleep = sleep
        self._chance = Random(f"{plan.seed} events")
        self._events = 0
        self._order = count()
        self._due: list[tuple[float, int, Call]] = []
        for at, vehicle in enumerate(vehicles):
            self._enlist(vehicle, at / len(vehicles))
        if plan.denm_hz:
            self._plan_call(self._chance.expovariate(plan.denm_hz), self._happen)

    def run(self, duration: float | None) -> Iterator[None]:
        """Send all messages that are due within `duration` seconds; None: without end. Yields once a second."""
        start = self._clock()
        try:
            yield from self._run(start, duration)
        finally:
            self.sent.seconds = self._clock() - start

    def _run(self, start: float, duration: float | None) -> Iterator[None]:
        told = start + 1.0
        while duration is None or self._due[0][0] < duration:
            due, _, call = heappop(self._due)
            self._wait(start + due)
            again = call(due)
            if again is not None:
                self._plan_call(again, call)
            if self._clock() >= told:
                told += 1.0
                self.sent.seconds = self._clock() - start
                yield

    def _wait(self, due: float) -> None:
        left = due - self._clock()
        if left > 0:
            self._sleep(left)
        else:
            self.sent.latest_s = max(self.sent.latest_s, -left)
            self.sent.late += -left > LATE_S

    def _plan_call(self, due: float, call: Call) -> None:
        heappush(self._due, (due, next(self._order), call))

    def _enlist(self, vehicle: Vehicle, phase: float) -> None:
        """Schedule the messages of a vehicle; phase, from 0 to 1, spreads the vehicles over one period."""
        plan = self._plan
        period, cam = (CHECK_S, self._check) if plan.cam_hz is None else (1 / plan.cam_hz, self._cam)
        self._plan_call(phase * period, _steadily(period, partial(cam, vehicle)))
        if plan.cpm_hz:
            self._plan_call(phase / plan.cpm_hz, _steadily(1 / plan.cpm_hz, partial(self._cpm, vehicle)))

    def _check(self, vehicle: Vehicle, due: float) -> None:
        if vehicle.generation.is_due(due, vehicle.move(due)):
            self._cam(vehicle, due)

    def _cam(self, vehicle: Vehicle, due: float) -> None:
        its_ms = self._its_ms()
        self._send(vehicle, CAM, vehicle.cam(due, its_ms), due, its_ms)

    def _cpm(self, vehicle: Vehicle, due: float) -> None:
        its_ms, own = self._its_ms(), vehicle.move(due)
        near = islice((one for one in self._vehicles if _is_near(vehicle, own, one)), MOST_OBJECTS)
        pdu = self._writer.cpm(vehicle.station_id, its_ms, own, [(one.number, one.motion) for one in near])
        self._send(vehicle, CPM, pdu, due, its_ms)

    def _happen(self, due: float) -> float:
        """Start a new event at a random vehicle; return the time of the next event."""
        vehicle = self._vehicles[self._chance.randrange(len(self._vehicles))]
        self._events += 1
        event = Event(vehicle, self._events, vehicle.move(due), self._its_ms())
        self._plan_call(due, partial(self._tell, event))
        return due + self._chance.expovariate(self._plan.denm_hz)

    def _tell(self, event: Event, due: float) -> float | None:
        its_ms = self._its_ms()
        is_over = event.told == REPETITIONS
        event.told += 1
        sender = event.vehicle
        pdu = self._writer.denm(sender.station_id, event.sequence, event.detected_ms, its_ms, event.position, is_over)
        sender.move(due)
        self._send(sender, DENM, pdu, due, its_ms, area_around(event.position))
        return None if is_over else due + REPEAT_S

    def _send(
        self, vehicle: Vehicle, kind: MessageType, pdu: bytes, now: float, its_ms: int, area: Area | None = None
    ) -> None:
        self._out(vehicle, kind, pdu, now, its_ms, area)
        self.sent.types[kind.name] += 1
        self.sent.stations[kind.name, vehicle.station_id] += 1

    def _its_ms(self) -> int:
        return nearest_its_time_ms(self._wall())


def _steadily(period: float, do: Callable[[float], None]) -> Call:
    """Return an action that repeats without drift."""
    first: float | None = None
    times = 0

    def call(due: float) -> float:
        nonlocal first, times
        first = due if first is None else first
        times += 1
        do(due)
        return first + times * period

    return call


def _is_near(vehicle: Vehicle, own: Motion, other: Vehicle) -> bool:
    return other is not vehicle and distance_m(own, other.motion) <= REACH_M
