"""captain swarm: simulates many virtual stations in one process."""

import argparse
import json
import resource
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from random import Random

from board.runtime.errors import RequestError, StationError
from drivers.message import Area, MessageType
from drivers.sim.track import Point
from firmware.client import client
from firmware.client.arguments import add_station, address, finite, integer, number, seconds, udp_address
from firmware.codec.reading import Pdu
from firmware.printable import clean, folded
from firmware.replay.ending import until_sigterm
from firmware.replay.ends import Datagrams, DeviceEnd, StationEnd, station_lines, unsent
from firmware.replay.reasons import count
from firmware.swarm import tracks
from firmware.swarm.audience import Audience, StationAddress, ear_of
from firmware.swarm.messages import CPMS, Writer
from firmware.swarm.swarm import LATE_S, Plan, Sent, Swarm
from firmware.swarm.vehicle import Vehicle, style

DESCRIPTION = """\
Sends the messages of many virtual stations, which drive around the blocks of a
simulated town:

  CAM   by the rules of EN 302 637-2: after a turn of 4 degrees, 4 m or 0.5 m/s;
        at least one, at most ten a second; the low frequency container with
        the path history every 500 ms. --rate sends at a fixed rate instead
  CPM   with --cpm: the other stations around each (TS 103 324)
  DENM  with --denm: accidents, repeated ten times, once a second, then
        cancelled

By default the swarm sends UDP to the station of --station. That station must
receive UDP: by its simulated radio (`captain run`) or a `udp` interface with
`listen` (both stations of `make run`). The swarm reads the address from the
station's status. It fails if no user of the station receives a message.

--udp and --ethernet send frames to any receiver. --endpoint gives messages to
the station's PULL socket, and the station sends them.
"""
EPILOG = """\
examples:
  captain swarm 20                          around the station of this machine:
                                            `captain run` or `make run`
  captain swarm 20 --station :5565          around station B of `make run`
  captain swarm 200 --rate 10 --duration 600 --udp 127.0.0.1:8947
                                            2,000 frames a second: more than one
                                            channel of ITS-G5 carries
  captain swarm 50 --cpm 2 --denm 0.1 --ethernet wlan0
                                            by 802.11p, with CPMs, and an
                                            accident every ten seconds
  captain swarm 10 --endpoint --duration 30
                                            into the station's PULL
  captain swarm 5 --track way.txt --speed 25
                                            along a track: a place a line,
                                            LATITUDE,LONGITUDE

exit codes:
  0    the duration was reached, or SIGTERM; the kernel accepted every message,
       or a station sent each by at least one interface
  1    a message was not sent, the station's users received none, no station
       answers, or the message library is missing
  2    wrong usage
  130  Ctrl-C
"""
FIRST_STATION = 100_001
MOST = 10_000


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("count", metavar="N", type=integer(1, MOST), help=f"number of stations, 1 to {MOST}")
    parser.add_argument("--duration", metavar="S", type=seconds, help="end after S seconds (default: Ctrl-C)")
    parser.add_argument(
        "--rate",
        metavar="HZ",
        type=number("CAMs a second", 1000.0),
        help="CAMs a second of each station, in place of the rules",
    )
    more = number("messages per second", 1000.0, is_zero_allowed=True)
    parser.add_argument("--cpm", metavar="HZ", type=more, default=0.0, help="CPMs a second of each station (default 0)")
    parser.add_argument("--cpm-edition", choices=CPMS, default=CPMS[0], help=f"edition of the CPMs (default {CPMS[0]})")
    parser.add_argument(
        "--denm", metavar="HZ", type=more, default=0.0, help="new accidents a second, in all (default 0)"
    )
    parser.add_argument(
        "--speed", metavar="M/S", type=number("m/s", 70.0), default=13.9, help="mean speed (default 13.9: 50 km/h)"
    )
    parser.add_argument(
        "--centre",
        metavar="LAT,LON",
        type=_place,
        default=Point(48.7668616, 11.4320680, 420.0),
        help="centre of the town",
    )
    parser.add_argument("--track", metavar="FILE", type=Path, help="drive along the track in FILE, not around blocks")
    parser.add_argument(
        "--first-id", metavar="N", type=integer(1, 2**32 - 1 - MOST), default=FIRST_STATION, help="first stationID"
    )
    parser.add_argument(
        "--seed", metavar="N", type=integer(0, 2**63), default=1, help="seed of all random numbers (default 1)"
    )
    parser.add_argument("--json", action="store_true", help="the summary as one JSON object")
    end = parser.add_argument_group("destination").add_mutually_exclusive_group()
    end.add_argument(
        "--udp", metavar="HOST:PORT", type=udp_address, help="send frames in datagrams (default: to the station)"
    )
    end.add_argument("--ethernet", metavar="DEVICE", help="send frames by a network device")
    end.add_argument("--endpoint", action="store_true", help="send to the station's PULL, as its user")
    add_station(parser)


def main(arguments: argparse.Namespace) -> int:
    """Send the messages of virtual stations.

    Raises StationError with the first reason if a message was not sent or none was received, after the summary.
    """
    writer = Writer(arguments.cpm_edition)
    vehicles = list(_vehicles(arguments, writer))
    plan = Plan(arguments.rate, arguments.cpm, arguments.denm, arguments.seed)
    with ExitStack() as ending:
        out = Air(arguments, ending)
        swarm = Swarm(vehicles, plan, writer, out, sleep=out.sleep)
        before_s = _cpu_s()
        try:
            with until_sigterm():
                for _ in swarm.run(arguments.duration):
                    if sys.stderr.isatty() and not arguments.json:
                        print(f"\r{swarm.sent.seconds:.0f} s: {_told(swarm.sent)}", end="", file=sys.stderr, flush=True)
            out.finish()
        finally:
            if out.station is not None:
                out.station.close()
            told = swarm.sent, out, _cpu_s() - before_s
            print(_json(*told) if arguments.json else folded("\n".join(_lines(*told)), sys.stdout), flush=True)
        if (cause := out.cause) is not None and not arguments.json:
            raise cause
    return 0 if cause is None else 1


def _vehicles(arguments: argparse.Namespace, writer: Writer) -> Iterator[Vehicle]:
    stations, chance = arguments.count, Random(f"{arguments.seed} styles")
    ways = [tracks.read(arguments.track)] * stations if arguments.track else tracks.town(arguments.centre, stations)
    for at, way in enumerate(ways):
        yield Vehicle(at, arguments.first_id + at, way, style(chance, arguments.speed, way.length_m), writer)


class Air:
    """Destination of the messages.

    refused        number of messages that were not sent.
    why            their number by reason.
    ear, audience  address and user of the station that receives them by default; None with --udp, --ethernet or
                   --endpoint.
    """

    def __init__(self, arguments: argparse.Namespace, ending: ExitStack) -> None:
        self.refused = 0
        self.why: Counter[str] = Counter()
        self.ear: StationAddress | None = None
        self.audience: Audience | None = None
        self.end = self._made(arguments, ending)

    def _made(self, arguments: argparse.Namespace, ending: ExitStack) -> StationEnd | DeviceEnd | Datagrams:
        place = address(arguments)
        if arguments.endpoint:
            return StationEnd(ending.enter_context(client.session()), place, "swarm", is_paced=True)
        if arguments.ethernet:
            device = DeviceEnd(arguments.ethernet)
            ending.callback(device.close)
            return device
        if arguments.udp is None:
            self.ear = ear_of(client.status(place), place.host)
            stations = range(arguments.first_id, arguments.first_id + arguments.count)
            self.audience = Audience(ending.enter_context(client.session()), place, stations)
        datagrams = Datagrams(self.ear.to, self.ear.framing) if self.ear else Datagrams(arguments.udp, "ethernet")
        ending.callback(datagrams.close)
        return datagrams

    @property
    def unheard(self) -> int:
        """Number of datagrams that the peer's machine rejected because no program listens."""
        return self.end.unheard if isinstance(self.end, Datagrams) else 0

    @property
    def station(self) -> StationEnd | None:
        return self.end if isinstance(self.end, StationEnd) else None

    @property
    def is_received(self) -> bool | None:
        """Whether a user of the station has received a message; None if unknown."""
        return None if self.audience is None else self.audience.is_reached

    @property
    def cause(self) -> StationError | None:
        """First reason for exit code 1; None for exit code 0."""
        for why in self.why:
            return StationError(f"{self.refused} messages were not sent: {why}")
        if (cause := unsent(self.end)) is not None:
            return cause
        if self.is_received is False:
            return StationError("no user of the station received a message", "look at `captain status`")
        return None

    def finish(self) -> None:
        """Wait a little for the last confirms and receptions."""
        if self.station is not None:
            self.station.finish()
        if self.audience is not None:
            self.audience.wait()

    def __call__(
        self, vehicle: Vehicle, kind: MessageType, pdu: bytes, now: float, its_ms: int, area: Area | None
    ) -> None:
        frame = vehicle.frame(kind, pdu, now, its_ms, area)
        one = Pdu(pdu, f"station {vehicle.station_id}", kind.btp_port, frame=frame)
        try:
            self.end.send(self.end.octets(one), one)
        except RequestError as error:
            self.refused += 1
            count(self.why, error.message.removeprefix(f"{one.origin}: "))

    def sleep(self, left: float) -> None:
        """Wait `left` seconds; receive confirms meanwhile."""
        until = time.monotonic() + left
        while time.monotonic() < until:
            self.end.wait(until)
        if self.audience is not None:
            self.audience.look()


def _told(sent: Sent) -> str:
    return ", ".join(f"{times} {kind.upper()}" for kind, times in sorted(sent.types.items())) or "no message yet"


def _lines(sent: Sent, out: Air, cpu_s: float) -> Iterator[str]:
    rate = sent.total / sent.seconds if sent.seconds else 0.0
    stations = len({station for _, station in sent.stations})
    yield f"{sent.total} messages of {stations} stations in {sent.seconds:.1f} s: {rate:.1f} a second: {_told(sent)}"
    if sent.seconds:
        yield f"processor: {cpu_s / sent.seconds:.1%} of one core"
    if sent.late:
        yield f"{sent.late} were more than {LATE_S:g} s late, up to {sent.latest_s:.2f} s: this machine is too slow"
    if out.ear is not None:
        got = "its users receive them" if out.is_received else "its users received none"
        yield f"station {out.ear.station} listens on {out.ear.to}; {got}"
    if out.unheard:
        yield f"{out.unheard} refused: no program listens at the address"
    for why, times in sorted(out.why.items()):
        yield f"not sent: {times}: {why}"
    if out.station is not None:
        yield from map(clean, station_lines(out.station))


def _json(sent: Sent, out: Air, cpu_s: float) -> str:
    stations: dict[str, dict[int, int]] = {}
    for (kind, station), times in sorted(sent.stations.items()):
        stations.setdefault(kind, {})[station] = times
    return json.dumps(
        {
            "sent": sent.total,
            "seconds": sent.seconds,
            "types": dict(sent.types),
            "stations": stations,
            "late": sent.late,
            "latest_s": sent.latest_s,
            "to": str(out.ear.to) if out.ear is not None else None,
            "is_received": out.is_received,
            "unheard": out.unheard,
            "refused": out.refused,
            "why": dict(out.why),
            "outcomes": out.station.outcomes if out.station is not None else {},
            "fates": dict(out.station.fates) if out.station is not None else {},
            "cpu_s": cpu_s,
        }
    )


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


# -- parsers of options


def _place(text: str) -> Point:
    latitude, comma, longitude = text.partition(",")
    north, east = finite(latitude), finite(longitude)
    if not comma or north is None or east is None or abs(north) > 89 or abs(east) > 180:
        raise argparse.ArgumentTypeError(f"{text!r}: not LATITUDE,LONGITUDE in degrees; for example 48.7668,11.4320")
    return Point(north, east, 420.0)
