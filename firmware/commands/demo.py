"""captain demo: starts two simulated stations with a user's program at each, and shows them live."""

import argparse
import math
import shutil
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import zmq

from board.runtime.address import Address
from board.runtime.free_udp import free_udp
from firmware.client import client
from firmware.client.arguments import seconds
from firmware.client.show.table import Screen, Table
from firmware.client.show.tally import HEADS, TallyRow, cells, folded
from firmware.codec.decoding import Decoder
from firmware.codec.library import NoLibraryError, load
from firmware.codec.rows import DECODED_HEADS, cells_of
from firmware.lab import ports
from firmware.lab.demo_user import MAC, PATH, SUBJECTS, User
from firmware.lab.program import Program

DESCRIPTION = """\
Starts two stations, A and B, which hear each other by ITS-G5 simulated with
UDP on the loopback. A hears two simulated neighbours too. At each station a
user's program sends a CAM ten times a second and a DENM once a second. Two
tables show what the users of A and of B receive, and what the last message
says; a station that was silent for 10 s is not shown.

The first lines name the ports for your own programs. What your program sends
to A is in the table of B's user, and the reverse. A takes the ports 5555 to
5558; where these are in use, the next free ones.
Ctrl-C ends both stations; without a terminal they end after 20 s.
"""
EPILOG = """\
examples:
  captain demo                            until Ctrl-C
  captain demo --duration 10              ten seconds
  captain listen                          (in another terminal) what A's users
                                          receive
  captain status --station :5565          (in another terminal) station B

exit codes:
  0    A and B have received each other's CAMs and DENMs
  1    they have not, or a station could not start
  2    wrong usage
"""
HOST = "127.0.0.1"
FIRST_PORT = 5555
WITHOUT_TERMINAL_S = 20.0
CAM_S = 0.1  # T_GenCamMin, EN 302 637-2 clause 6.1.3
REDRAW_S = 0.5
LATE_S = 2.0  # seconds to wait at the end for the first messages
PRINT_S = 5.0  # interval of tables without a terminal
GONE_S = 10.0  # rows of stations that were silent for longer are hidden; a single message is visible for as long
INTRODUCTION = 6  # lines above the tables, including the empty one
HEADING = 2  # lines of each table above its rows
# Board of both stations: that of board/boards/sim.toml, but with free UDP ports and each other as peers.
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
        decoder = _decoder()
        users = [User(context, station.name, station.place, decoder) for station in stations]
        print(introduction(stations), flush=True)
        try:
            for user in users:
                user.join()
            _watch(users, stations, duration, decoder)
        except KeyboardInterrupt:
            print()  # moves the output below the ^C that the terminal has echoed
    print("\n".join(summary(users)))
    return 0 if _all_have_heard(users) else 1


def _all_have_heard(users: Sequence["User"]) -> bool:
    return all(user.has_heard(other) for user in users for other in users if other is not user)


class DemoStation(NamedTuple):
    """Running station of the demo."""

    name: str
    place: client.Address
    process: Program


def _start(ending: ExitStack) -> list[DemoStation]:
    """Start both stations and wait until they are ready. Raises StationError if one is not."""
    blocks = ports.free_blocks(HOST, FIRST_PORT, 4)
    firsts = [next(blocks), next(blocks)]
    if firsts[0] != FIRST_PORT:
        there = ports.running(FIRST_PORT)
        who = ports.holder(there) if there else "another program"
        print(f"Ports {FIRST_PORT} to {FIRST_PORT + 3} are in use ({who}). A takes {firsts[0]} to {firsts[0] + 3}.\n")
    stations = []
    for (name, board), first in zip(boards(free_udp(HOST, 3)), firsts, strict=True):
        given = ["run", "--board", "/dev/stdin", "--log", "warning"]
        given += ["--set", f"station.name={name}", "--set", f"station.mac={MAC[name]}"]
        centre = PATH[name].centre
        given += ["--set", f"station.position={{latitude={centre.latitude}, longitude={centre.longitude}}}"]
        for at, key in enumerate(("from_users", "to_users", "pull", "report")):
            given += ["--set", f"endpoint.{key}={first + at}"]
        child = Program(f"station {name}", given, board.encode())
        ending.callback(child.stop)
        place = client.Address(HOST, *range(first, first + 4))
        stations.append(DemoStation(name, place, child))
    for station in stations:
        station.process.wait_until_ready()
    return stations


def boards(udp: Sequence[Address]) -> list[tuple[str, str]]:
    """Return name and board file of A and B; udp: addresses of A's radio, B's radio and the neighbours."""
    a, b, neighbours = udp
    of_a = BOARD.format(own=a, peers=f'"{b}", "{neighbours}"')
    of_b = BOARD.format(own=b, peers=f'"{a}"')
    return [("A", of_a + NEIGHBOURS.format(own=a, neighbours=neighbours)), ("B", of_b)]


def _watch(
    users: Sequence[User], stations: Sequence[DemoStation], duration: float | None, decoder: Decoder | None
) -> None:
    """Send, receive and show messages until the duration is over. Raises StationError if a station ends."""
    poller = zmq.Poller()
    for user in users:
        poller.register(user.subscriber, zmq.POLLIN)
    for station in stations:
        poller.register(station.process, zmq.POLLIN)
    with Screen() as screen:

        def show(now: float) -> None:
            screen.show(view(users, now, screen.height - INTRODUCTION, decoder))

        def look(timeout_s: float) -> float:
            """Process what arrives within a time, and return the monotonic time afterwards."""
            poller.poll(max(0, math.ceil(timeout_s * 1000)))
            now = time.monotonic()
            for user in users:
                user.receive(now)
            for station in stations:
                station.process.check()
            return now

        start = due = time.monotonic()
        redraw_s = REDRAW_S if screen.is_terminal else PRINT_S
        redraw, mark = start + redraw_s, start + 1.0
        try:
            while duration is None or time.monotonic() < start + duration:
                now = look(due - time.monotonic())
                if now >= due:
                    due += CAM_S
                    for user in users:
                        user.send()
                if now >= redraw:
                    redraw += redraw_s
                    show(now)
                if now >= mark:
                    mark += 1.0
                    for user in users:
                        user.tally.mark(now)
            # The last messages may still be under way, and may be the first of their type.
            late = time.monotonic() + LATE_S
            while not _all_have_heard(users) and (left := late - time.monotonic()) > 0:
                look(left)
        finally:
            show(time.monotonic())


def _decoder() -> Decoder | None:
    """Return a decoder; None without the message library: then the tables show sizes instead of contents."""
    try:
        return Decoder(load())
    except NoLibraryError:
        return None


def introduction(stations: Sequence[DemoStation]) -> str:
    """Return text on the ports for the user's own programs: INTRODUCTION lines, the last one empty."""
    lines = [
        "Stations A and B hear each other. A also hears two simulated neighbours.",
        "Your program  sends (PUB) to        receives (SUB) from",
    ]
    for name, place, _ in stations:
        lines.append(f"  at {name}        {place.url(place.from_users)}  {place.url(place.to_users)}")
    at = stations[-1].place.from_users
    lines.append(f"Ctrl-C ends both. In another terminal: {_program()} listen --station :{at}\n")
    return "\n".join(lines)


def _program() -> str:
    """Return the command of this program in another terminal: its path if `captain` in PATH is another one."""
    started = sys.argv[0]
    found = shutil.which("captain")
    if Path(started).name != "captain" or (found and Path(found).resolve() == Path(started).resolve()):
        return "captain"
    return started


def view(users: Sequence[User], now: float, height: int, decoder: Decoder | None) -> list[Table]:
    """Return a table for each user, without stations that are gone; height: lines for all tables together."""
    heard = {user.name: [row for row in user.tally.rows() if row.last > now - GONE_S] for user in users}
    shown = {name: sorted(rows, key=_is_of_neighbour) for name, rows in heard.items()}
    left = height - len(users) * HEADING - (len(users) - 1)
    # The shorter table is sized first, so that the other one gets the lines that it does not need.
    for sharing, name in zip(range(len(users), 0, -1), sorted(shown, key=lambda name: len(shown[name])), strict=True):
        shown[name] = folded(shown[name], max(1, left // sharing))
        left -= len(shown[name])
    return [_table(user, shown[user.name], now, decoder) for user in users]


def _table(user: User, rows: Sequence[TallyRow], now: float, decoder: Decoder | None) -> Table:
    heads: Sequence[str] = HEADS if decoder is None else DECODED_HEADS
    rssi = heads.index(">dBm")  # the simulated radio reports no signal strength
    lines = []
    for row in rows:
        shown = cells(row, now) if decoder is None else cells_of(row, now, decoder)
        lines.append((_sender(row), *shown[:rssi], *shown[rssi + 1 :]))
    rubbish = f", {user.pairing.rubbish} unreadable" if user.pairing.rubbish else ""
    title = f"received by {user.name}'s user: {user.tally.total} messages{rubbish}"
    return Table(title, ("from", *heads[:rssi], *heads[rssi + 1 :]), lines)


def _is_of_neighbour(row: TallyRow) -> bool:
    return row.source not in MAC.values()


def _sender(row: TallyRow) -> str:
    """Return the sender's name by the source address, which all users of a station share."""
    if not row.source:
        return ""
    return next((f"{name}'s user" for name, mac in MAC.items() if mac == row.source), "neighbour")


def summary(users: Sequence[User]) -> list[str]:
    """Return the last lines: the number of messages that each user received from the other."""
    lines = []
    for user in users:
        for other in users:
            if other is not user:
                counts = [f"{user.tally.count(kind, other.station_id)} {kind.upper()}" for kind in SUBJECTS]
                lines.append(f"{user.name} received {' and '.join(counts)} from {other.name}'s user.")
    return lines
