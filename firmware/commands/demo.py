"""captain demo: two simulated stations and a user's program at each, watched live."""

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import zmq

import firmware
from board.address import Address
from board.errors import StationError
from board.free_udp import free_udp
from firmware.lab import ports
from firmware.lab.program import Program
from firmware.user import client
from firmware.user.arguments import seconds
from firmware.user.received import Pairing
from firmware.user.table import Screen, Table
from firmware.user.tally import HEADS, Tally, cells

DESCRIPTION = """\
Starts two stations, A and B, which hear each other through UDP on the
loopback: the ITS-G5 of the simulated board. A has simulated neighbours too.
At each station a user's program sends a CAM ten times a second and a DENM once
a second; the table shows what the users of both stations receive.

The first lines say where your own programs may connect meanwhile. A takes the
ports 5555 to 5558, or the next free ones when a station has these already.
Ctrl-C ends everything; without a terminal it ends after 20 s.
"""
EPILOG = """\
examples:
  captain demo                            until Ctrl-C
  captain demo --duration 10              ten seconds
  captain listen                          (elsewhere, meanwhile) A's user's view
  captain status --station :5565          (elsewhere, meanwhile) station B

exit codes:
  0    A and B have received each other's CAMs and DENMs
  1    they have not, or a station could not start
  2    wrong usage
"""
HOST = "127.0.0.1"
FIRST_PORT = 5555
WITHOUT_TERMINAL_S = 20.0
CAM_S = 0.1  # T_GenCamMin, EN 302 637-2 clause 6.1.3
CAMS_PER_DENM = 10
REDRAW_S = 0.5
LATE_S = 2.0  # what has not come so long after the end has not come
PRINT_S = 5.0  # where lines stay on the screen
STATION_ID = {"A": 4201, "B": 4202}  # of the users' messages
SUBJECTS = ("cam", "denm")

# The board of both: the simulated one of board/boards/sim.toml with free UDP ports and each other as peers.
BOARD = """\
name = "demo"
[interfaces.g5]
driver = "udp"
framing = "ethernet"
listen = "{own}"
peers = [{peers}]
"""
NEIGHBOURS = """\
[neighbours]
listen = "{neighbours}"
to = "{own}"
"""


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--duration", metavar="S", type=seconds, help="end after so many seconds")


def main(arguments: argparse.Namespace) -> int:
    duration = arguments.duration
    if duration is None and not sys.stdin.isatty():
        duration = WITHOUT_TERMINAL_S
    with ExitStack() as ending:
        stations = _start(ending)
        context = ending.enter_context(client.session())
        users = [User(context, station) for station in stations]
        print(introduction(stations), flush=True)
        try:
            for user in users:
                user.join()
            _watch(users, stations, duration)
        except KeyboardInterrupt:
            print()  # the terminal's ^C stands alone
    print("\n".join(summary(users)))
    return 0 if _all_have_heard(users) else 1


def _all_have_heard(users: Sequence["User"]) -> bool:
    return all(user.has_heard(other) for user in users for other in users if other is not user)


class Station(NamedTuple):
    """One of the two."""

    name: str
    place: client.Address
    process: Program


def _start(ending: ExitStack) -> list[Station]:
    """Both stations, ready. Raises StationError when one is not."""
    blocks = ports.free_blocks(HOST, FIRST_PORT, 4)
    firsts = [next(blocks), next(blocks)]
    if firsts[0] != FIRST_PORT:
        there = ports.running(FIRST_PORT)
        who = ports.holder(there) if there else "another program"
        print(f"Ports {FIRST_PORT} to {FIRST_PORT + 3} are not free ({who}): A takes {firsts[0]} and following.\n")
    stations = []
    for (name, board), first in zip(boards(free_udp(HOST, 3)), firsts, strict=True):
        given = ["run", "--board", "/dev/stdin", "--log", "warning", "--set", f"station.name={name}"]
        for at, key in enumerate(("from_users", "to_users", "pull", "report")):
            given += ["--set", f"endpoint.{key}={first + at}"]
        child = Program(f"station {name}", given, board.encode())
        ending.callback(child.stop)
        place = client.Address(HOST, *range(first, first + 4))
        stations.append(Station(name, place, child))
    for station in stations:
        station.process.wait_until_ready()
    return stations


def boards(udp: Sequence[Address]) -> list[tuple[str, str]]:
    """Name and board file of A and B; udp are the addresses of A's radio, B's, and the neighbours'."""
    a, b, neighbours = udp
    of_a = BOARD.format(own=a, peers=f'"{b}", "{neighbours}"')
    of_b = BOARD.format(own=b, peers=f'"{a}"')
    return [("A", of_a + NEIGHBOURS.format(own=a, neighbours=neighbours)), ("B", of_b)]


class User:
    """A user's program at a station, as the README has it: PUB to 5555, SUB to 5556."""

    def __init__(self, context: client.Context, station: Station) -> None:
        self.name = station.name
        self.station_id = STATION_ID[station.name]
        self.tally = Tally()
        self.pairing = Pairing()
        place = station.place
        self.subscriber = client.subscribe(context, place, place.to_users, "")
        # On the wire an XPUB is a PUB; it also tells when the station has subscribed, before which all is lost.
        self._publisher = context.socket(zmq.XPUB)
        self._publisher.connect(place.url(place.from_users))
        self._cams = 0
        self._pdus = {kind: pdu_of(kind, self.station_id) for kind in SUBJECTS}

    def join(self) -> None:
        """Wait until the station listens, and something came of it: then nothing more is lost. Raises StationError."""
        patience_ms = round(client.ANSWER_S * 1000)
        if not self._publisher.poll(patience_ms) or not self.subscriber.poll(patience_ms):
            raise StationError(f"station {self.name} does not answer its user")

    def send(self) -> None:
        """A CAM, and with every tenth a DENM."""
        self._publish("cam")
        if self._cams % CAMS_PER_DENM == 0:
            self._publish("denm")
        self._cams += 1

    def receive(self, now: float) -> None:
        for frames in client.waiting(self.subscriber):
            message = self.pairing.feed(frames)
            if message is not None:
                self.tally.add(message, now)

    def has_heard(self, other: "User") -> bool:
        """Whether both types have come from the other's user."""
        return all(self.tally.count(kind, other.station_id) for kind in SUBJECTS)

    def _publish(self, kind: str) -> None:
        self._publisher.send_multipart([f"v2x.{kind}.".encode(), self._pdus[kind]], zmq.DONTWAIT)


def pdu_of(kind: str, station_id: int) -> bytes:
    """The shortest message of a type in firmware/vectors.json, from this station."""
    vectors = json.loads((Path(firmware.__file__).parent / "vectors.json").read_bytes())
    pdu = min((bytes.fromhex(one["hex"]) for one in vectors if one["type"] == kind), key=len)
    return pdu[:2] + station_id.to_bytes(4) + pdu[6:]


def _watch(users: Sequence[User], stations: Sequence[Station], duration: float | None) -> None:
    """Send, receive and show until the time is over. Raises StationError when a station ends."""
    poller = zmq.Poller()
    for user in users:
        poller.register(user.subscriber, zmq.POLLIN)
    for station in stations:
        poller.register(station.process, zmq.POLLIN)
    with Screen() as screen:
        start = due = time.monotonic()
        redraw_s = REDRAW_S if screen.is_terminal else PRINT_S
        redraw, mark = start + redraw_s, start + 1.0
        while duration is None or time.monotonic() < start + duration:
            poller.poll(max(0, round((due - time.monotonic()) * 1000)))
            now = time.monotonic()
            for user in users:
                user.receive(now)
            for station in stations:
                station.process.check()
            if now >= due:
                due += CAM_S
                for user in users:
                    user.send()
            if now >= redraw:
                redraw += redraw_s
                screen.show(view(users, now, screen.height))
            if now >= mark:
                mark += 1.0
                for user in users:
                    user.tally.mark(now)
        # The last messages are still on their way, and may be the first.
        late = time.monotonic() + LATE_S
        while not _all_have_heard(users) and (left := late - time.monotonic()) > 0:
            poller.poll(math.ceil(left * 1000))
            for user in users:
                user.receive(time.monotonic())
            for station in stations:
                station.process.check()


def introduction(stations: Sequence[Station]) -> str:
    """What a newcomer needs to connect a program."""
    lines = ["Two stations that hear each other, and simulated neighbours of A. Your programs connect"]
    for name, place, _ in stations:
        lines.append(f"  to {name}: PUB to {place.url(place.from_users)}, SUB to {place.url(place.to_users)}")
    at = stations[0].place.from_users
    lines.append(f"Try `captain listen --station :{at}`, `captain status --station :{at}`. Ctrl-C ends it all.\n")
    return "\n".join(lines)


def view(users: Sequence[User], now: float, height: int) -> list[Table]:
    """One table for each user; height in lines for all."""
    most = max(1, height // len(users) - 5)
    tables = []
    for user in users:
        rows = [(_sender(row.station), *cells(row, now)) for row in user.tally.rows(most)]
        rubbish = f", {user.pairing.rubbish} unreadable" if user.pairing.rubbish else ""
        tables.append(
            Table(f"received by {user.name}'s user: {user.tally.total} messages{rubbish}", ("from", *HEADS), rows)
        )
    return tables


def _sender(station: int | str | None) -> str:
    names = {number: f"{name}'s user" for name, number in STATION_ID.items()}
    return names.get(station, "neighbour") if isinstance(station, int) else ""


def summary(users: Sequence[User]) -> list[str]:
    """The last lines: what each has received from the other."""
    lines = []
    for user in users:
        for other in users:
            if other is not user:
                counts = [f"{user.tally.count(kind, other.station_id)} {kind.upper()}" for kind in SUBJECTS]
                lines.append(f"{user.name} received {' and '.join(counts)} from {other.name}'s user.")
    return lines
