"""captain impair: a bad way between two interfaces."""

import argparse
import json
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, replace
from typing import NamedTuple, TypeAlias

from board.address import Address
from board.address import address as udp_address
from board.errors import ConfigurationError, UsageError
from drivers.wire.impairment import Impairment
from firmware.codec.reading import Pdu
from firmware.printable import clean
from firmware.replay import ears, ends
from firmware.replay.arguments import add_impairments, impairments, told
from firmware.replay.bridge import Bridge, Side, Way
from firmware.user import client
from firmware.user.arguments import seconds, station

DESCRIPTION = """\
Stands between A and B and passes on what each sends to the other, but for what
a bad way takes: losses one by one or in bursts, delay and jitter, reordering,
copies, wrong bits. Each is counted to the packet, and the same seed does the
same again. A side is

  udp:LISTEN,PEER   hears datagrams at LISTEN, and sends to PEER: HOST:PORT each, or
                    :PORT of this machine
  ethernet:DEVICE   hears and sends frames of GeoNetworking on a network device
  station:HOST[:PORT]
                    hears what a station's users receive, and gives to its PULL,
                    of which `captain status` tells what left; a user of it that
                    fell behind is told

Between two stations with udp interfaces, each has this program as its peer:
LISTEN is what the station sends to, PEER where it listens. Frames become
messages for a station's endpoint, and its messages become frames.
"""
EPILOG = """\
examples:
  captain impair udp::9001,:8947 udp::9002,:8948 --loss 0.1 --delay 0.05
                                      between two stations of this machine, of
                                      which one sends to 9001, the other to 9002
  captain impair ethernet:veth1 ethernet:veth2 --burst 0.01:0.25
                                      between two devices (as root)
  captain impair station:10.0.0.2 udp::9002,:8948 --one-way
                                      what a station elsewhere receives, to an
                                      interface here

exit codes:
  0    the duration is reached, or SIGTERM
  1    an address is taken, a device is not there, or no station answers
  2    wrong usage
  130  Ctrl-C
"""
HOST = "127.0.0.1"
Opening: TypeAlias = Callable[[argparse.Namespace, ExitStack], tuple[ears.Ear, ends.End]]


def arguments(parser: argparse.ArgumentParser) -> None:
    for name in ("A", "B"):
        parser.add_argument(
            name.lower(), metavar=name, type=side, help=f"side {name}: udp:..., ethernet:... or station:..."
        )
    parser.add_argument("--one-way", action="store_true", help="from A to B only")
    parser.add_argument("--duration", metavar="S", type=seconds, help="end after so many seconds (default: Ctrl-C)")
    parser.add_argument(
        "--framing", choices=("ethernet", "btp", "pdu"), default="ethernet", help="of datagrams (default ethernet)"
    )
    parser.add_argument("--json", action="store_true", help="the summary as one JSON object")
    add_impairments(parser)


def main(arguments: argparse.Namespace) -> int:
    wanted = impairments(arguments)
    _check(arguments.a, arguments.b)
    with ExitStack() as ending:
        a, b = (Side(one.name, *one.opening(arguments, ending)) for one in (arguments.a, arguments.b))
        ways = [Way(a, b, Impairment[Pdu](wanted))]
        if not arguments.one_way:
            # The other direction has chances of its own.
            ways.append(Way(b, a, Impairment[Pdu](replace(wanted, seed=wanted.seed + 1))))
        bridge, came = Bridge(ways), list[int]()

        def stop(number: int, _: object) -> None:
            came.append(number)
            bridge.stop()

        for number in (signal.SIGINT, signal.SIGTERM):
            ending.callback(signal.signal, number, signal.signal(number, stop))
        print(f"captain: between {a.name} and {b.name}", file=sys.stderr, flush=True)
        try:
            bridge.run(arguments.duration)
        finally:
            print(as_json(ways) if arguments.json else "\n".join(lines(ways)), flush=True)
    if signal.SIGINT in came:
        raise KeyboardInterrupt
    return 0


def lines(ways: list[Way]) -> Iterator[str]:
    for way in ways:
        yield f"{way.source.name} to {way.to.name}: {way.heard} heard, {way.sent} sent"
        if way.source.ear.missed:
            yield f"  {way.source.ear.missed} not heard: this machine is too slow"
        if behind := _behind(way):
            yield f"  a user of the station fell behind {behind} times: what it lost meanwhile is not counted here"
        if unheard := _unheard(way):
            yield f"  nobody listened to {unheard} of them"
        if words := told(way.impairment.counts):
            yield f"  {words}"
        for why, count in sorted(way.left_out.items()):
            yield clean(f"  left out: {count}: {why}")


def as_json(ways: list[Way]) -> str:
    return json.dumps(
        {
            "ways": [
                {
                    "from": way.source.name,
                    "to": way.to.name,
                    "heard": way.heard,
                    "missed": way.source.ear.missed,
                    "fell_behind": _behind(way),
                    "sent": way.sent,
                    "unheard": _unheard(way),
                    "left_out": dict(way.left_out),
                    "waiting": way.impairment.waiting,
                    **asdict(way.impairment.counts),
                }
                for way in ways
            ]
        }
    )


def _behind(way: Way) -> int:
    """Of a station's users, of which this program is one."""
    return way.source.ear.fell_behind() if isinstance(way.source.ear, ears.Station) else 0


def _unheard(way: Way) -> int:
    """Datagrams of which the other side said that nobody listens there."""
    return way.to.end.unheard if isinstance(way.to.end, ends.Datagrams) else 0


# -- sides


class Named(NamedTuple):
    """A side as it is written: where it hears and where it sends, and how it is opened."""

    name: str
    hears: object
    sends: object
    opening: Opening


def _check(a: Named, b: Named) -> None:
    """Raises UsageError where one of them hears what either sends: that would go round for ever."""
    ways = [(one, other) for one in (a, b) for other in (a, b) if isinstance(one.hears, Address)]
    for one, other in ways or [(a, b)]:
        if _is_heard(other.sends, one.hears):
            raise UsageError(
                f"{one.name} would hear what this program sends to {other.name}",
                "of udp:LISTEN,PEER: LISTEN is what the station sends to, PEER where it listens",
            )


def _is_heard(sent_to: object, at: object) -> bool:
    if not isinstance(sent_to, Address) or not isinstance(at, Address) or at.host != "0.0.0.0":
        return sent_to == at
    return sent_to.port == at.port and _is_here(sent_to.host)


def _is_here(host: str) -> bool:
    """Whether an address is this machine's, or a group's: the kernel binds to no other."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind((host, 0))
        except OSError:
            return False
    return True


def side(text: str) -> Named:
    """What a side is, and how it is opened."""
    kind, _, rest = text.partition(":")
    make = {"udp": _udp, "ethernet": _ethernet, "station": _station}.get(kind)
    if make is None or not rest:
        raise argparse.ArgumentTypeError(
            f"{text!r} is no side; write udp:LISTEN,PEER or ethernet:DEVICE or station:HOST[:PORT]"
        )
    return Named(text, *make(rest))


def _udp(text: str) -> tuple[object, object, Opening]:
    try:
        listen, peer = (udp_address(f"{HOST}{part}" if part.startswith(":") else part) for part in text.split(","))
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(f"udp:{text}: {error.message}") from error
    except ValueError:
        raise argparse.ArgumentTypeError(f"udp:{text}: write LISTEN,PEER: :9001,10.0.0.2:8947") from None

    def opening(arguments: argparse.Namespace, ending: ExitStack) -> tuple[ears.Ear, ends.End]:
        ear, end = ears.Datagrams(listen, arguments.framing), ends.Datagrams(peer, arguments.framing)
        ending.callback(ear.close)
        ending.callback(end.close)
        return ear, end

    return listen, peer, opening


def _ethernet(device: str) -> tuple[object, object, Opening]:
    def opening(_arguments: argparse.Namespace, ending: ExitStack) -> tuple[ears.Ear, ends.End]:
        ear, end = ears.Device(device), ends.Device(device)
        ending.callback(ear.close)
        ending.callback(end.close)
        return ear, end

    return device, device, opening


def _station(text: str) -> tuple[object, object, Opening]:
    host, first = station(text)
    place = client.Address(host, first, first + 1, first + 2, first + 3)

    def opening(_arguments: argparse.Namespace, ending: ExitStack) -> tuple[ears.Ear, ends.End]:
        context = ending.enter_context(client.session())
        ear, end = ears.Station(context, place), ends.Pull(context, place)
        ending.callback(ear.close)
        ending.callback(end.close)
        return ear, end

    return place, place, opening
