"""Tables of the paper: stations, a meter, and the injected loss."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from drivers.message import Position
from drivers.sim import drive
from firmware.client import client
from firmware.codec.library import load
from firmware.endpoint.report import digest_of
from firmware.lab.copies import Count
from firmware.lab.laboratory import Bench, Link, bench, vectors
from firmware.meter.fate import Fate
from firmware.meter.meter import Meter
from firmware.meter.probe import Probes
from firmware.meter.result import About, result
from firmware.meter.session import Session, TimeLine

TABLE_1_S = 10.0
RATE_HZ = 10.0
GRACE_S = 1.0
LAP_S = drive.drive().length_m / drive.SPEED_M_S


class Shown(NamedTuple):
    """Result of a table.

    result    measured result.
    verdict   comparison with the injected loss, as text.
    is_right  the measured loss is the injected one.
    """

    result: Mapping[str, object]
    verdict: list[str]
    is_right: bool


class _Measured(NamedTuple):
    made: Bench
    session: Session
    began_s: float

    def about(self, title: str, what: str, notes: tuple[str, ...]) -> About:
        stations = {watch.name: watch.told() for watch in self.session.watches}
        ended_s = self.session.ended_s or self.session.line()
        return About(title, what, self.began_s, ended_s - self.began_s, stations, notes)


@contextmanager
def _metered(link: Link, interval_s: float, more: str = "") -> Iterator[_Measured]:
    """Start two stations and a meter for both; yield them once the measurement has begun."""
    with bench(link, 0.0, None, more=more) as made, client.session() as context:
        line = TimeLine()
        session = Session(Meter(interval_s, GRACE_S), line)
        for seat in made.seats:
            session.watch(seat.name, seat.place, context)
        session.begin(is_first=True)
        yield _Measured(made, session, line())


def table_1(for_s: float | None, interval_s: float) -> Shown:
    """Exchange ten messages between two stations at 10 Hz each; compare the users' counts with the meter's."""
    duration_s = TABLE_1_S if for_s is None else for_s
    with _metered("udp", interval_s) as measured:
        seats, session = measured.made.seats, measured.session
        ten = [index for index, vector in enumerate(vectors()) if not vector.is_beside]
        count = Count(vectors(), [seat.name for seat in seats])

        def hear() -> None:
            for seat, sender in zip(seats, reversed(seats), strict=True):
                for message in seat.receive():
                    count.received(sender.name, message)

        def send(turn: int) -> None:
            index = ten[turn % len(ten)]
            for seat in seats:
                seat.send(count.vectors[index])
                count.sent(seat.name, index)
            hear()

        turns = round(duration_s * RATE_HZ) * len(ten)
        _paced(session, turns, RATE_HZ * len(ten), send)
        for seat in seats:
            session.wait_for(seat.name, turns)
        session.end()
        hear()
        about = measured.about("Table 1: ten messages between two stations", "captain meter table1", ())
        told = result(session.meter, about)
    rows = count.rows()
    lost, altered = sum(row.lost for row in rows), sum(row.altered for row in rows) + count.strange
    meter = session.meter
    sent, received = sum(row.sent for row in rows), sum(row.received for row in rows)
    is_right = (sent, received, lost, altered) == (meter.sent_count, meter.arrived, meter.lost, 0) and lost == 0
    verdict = [
        f"by the users' programs: {sent} sent, {received} received, {lost} lost, {altered} altered",
        f"by the meter:           {meter.sent_count} sent, {meter.arrived} received, {meter.lost} lost",
    ]
    return Shown(told, verdict, is_right)


def table_3(for_s: float | None, interval_s: float, from_s: float = 0.0) -> Shown:
    """Send CAMs at 10 Hz, by radio, between a parked station and a car that drives round its block of houses.

    The simulated radios cause the losses: drivers/sim/radio/path.h, with the block between them.

    from_s  start of the drive in seconds of the lap.
    """
    duration_s = LAP_S if for_s is None else for_s
    with _metered("radio", interval_s, drive.radio()) as measured:
        parked, car = measured.made.seats
        radios = dict(zip((parked.name, car.name), measured.made.radios, strict=True))
        radios[parked.name].say(drive.at(drive.PARKED))
        before = {name: radio.lost() for name, radio in radios.items()}
        track, session = drive.drive(), measured.session
        probes = {seat.name: Probes(load(), "cam", None, time.time) for seat in (parked, car)}

        def send(turn: int) -> None:
            there = track.at(from_s + turn / RATE_HZ)
            radios[car.name].say(drive.at(there))
            position = Position(there.latitude, there.longitude)
            for seat, station_id, where in ((parked, PARKED_ID, drive.fixed(drive.PARKED)), (car, CAR_ID, position)):
                pdu = probes[seat.name].next(station_id, where)
                session.meter.spots.note_message(digest_of(pdu), where)
                seat.send_pdu(pdu)

        turns = round(duration_s * RATE_HZ)
        _paced(session, turns, RATE_HZ, send)
        for seat in (parked, car):
            session.wait_for(seat.name, turns)
        session.end()
        injected = {name: radio.lost() - before[name] for name, radio in radios.items()}
        notes = (
            f"{parked.name} is parked at a corner of a block of {drive.WIDTH_M:g} m x {drive.LENGTH_M:g} m, {car.name} "
            f"drives round it at {drive.SPEED_M_S * 3.6:.0f} km/h; radios: {drive.RADIO}",
        )
        about = measured.about("Table 3: 10 Hz CAM round a block of houses", "captain meter table3", notes)
        told = result(session.meter, about)
    found = {way.receiver: one.whole for way, one in session.meter.ways.items()}
    verdict = [
        f"to {name}: {found[name].sent} sent, {injected[name]} lost by its radio; "
        f"measured: {found[name].arrived} arrived, {found[name].lost} lost"
        for name in radios
    ]
    is_right = all(found[name].lost == injected[name] and not found[name].counts[Fate.UNSEEN] for name in radios)
    return Shown(told, verdict, is_right)


PARKED_ID, CAR_ID = 1001, 1002


def _paced(session: Session, turns: int, rate_hz: float, send: Callable[[int], None]) -> None:
    """Call send() `turns` times at a rate; the meter processes reports between the calls."""
    start = time.monotonic()
    for turn in range(turns):
        session.serve(max(0.0, start + turn / rate_hz - time.monotonic()))
        send(turn)


SHOWS: dict[str, Callable[[float | None, float], Shown]] = {"table1": table_1, "table3": table_3}
