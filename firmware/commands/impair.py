"""captain impair: emulates a lossy link between two interfaces."""

import argparse
import json
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, replace
from typing import NamedTuple, TypeAlias

from board.runtime.address import Address
from board.runtime.address import address as udp_address
from board.runtime.errors import ConfigurationError, UsageError
from drivers.wire.impairment import Impairment
from firmware.client import client
from firmware.client.arguments import seconds, station
from firmware.codec.reading import Pdu
from firmware.printable import clean, folded
from firmware.replay import ears, ends
from firmware.replay.arguments import add_impairments, impairments, told
from firmware.replay.bridge import Bridge, Side, Way

DESCRIPTION = """\
Emulates a lossy link between A and B. It passes on messages of each side to the
other. It emulates single losses, bursts, delay, jitter, reordering, copies and
bit errors. It counts each of them; the same seed repeats all. A side is

  udp:LISTEN,PEER
            receives datagrams at LISTEN, sends to PEER: HOST:PORT each, or
            :PORT of this machine

  ethernet:DEVICE
            receives and sends GeoNetworking frames on a network device

  station:HOST[:PORT]
            receives messages as a user of a station, and sends to its PULL;
            `captain status` of that station tells what left

Two stations with udp interfaces have this program as their peer. LISTEN is the
address that the station sends to, PEER the one where it listens. Frames become
messages for a station's endpoint, and its messages become frames.
"""
EPILOG = """\
examples:
  captain impair udp::9001,:8947 udp::9002,:8948 --loss 0.1 --delay 0.05
                                      between two stations of this machine: one
                                      sends to 9001, the other to 9002
  captain impair ethernet:veth1 ethernet:veth2 --burst 0.01:0.25
                                      between two devices (as root)
  captain impair station:10.0.0.2 udp::9002,:8948 --one-way
                                      messages that a station elsewhere
                                      receives, to an interface here

exit codes:
  0    the duration was reached, or SIGTERM
  1    an address is in use, a device is missing, or no station answers
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
    parser.add_argument("--duration", metavar="S", type=seconds, help="end after S seconds (default: Ctrl-C)")
    parser.add_argument(
        "--framing",
        choices=("ethernet", "btp", "pdu"),
        default="ethernet",
        help="content of the datagrams (default ethernet)",
    )
    parser.add_argument("--json", action="store_true", help="the summary as one JSON object")
    add_impairments(parser)


def main(arguments: argparse.Namespace) -> int:
    """Pass frames between two sides until the end.

    Raises UsageError if a side would receive what this program sends.
    """
    wanted = impairments(arguments)
    _check(arguments.a, arguments.b)
    with ExitStack() as ending:
        a, b = (Side(one.name, *one.opening(arguments, ending)) for one in (arguments.a, arguments.b))
        ways = [Way(a, b, Impairment[Pdu](wanted))]
        if not arguments.one_way:
            # The other direction gets random numbers of its own.
            ways.append(Way(b, a, Impairment[Pdu](replace(wanted, seed=wanted.seed + 1))))
        bridge, came = Bridge(ways), list[int]()

        def stop(number: int, _: object) -> None:
            came.append(number)
            bridge.stop()

        for number in (signal.SIGINT, signal.SIGTERM):
            ending.callback(signal.signal, number, signal.signal(number, stop))
        begin = f"captain: lossy link between {a.name} and {b.name}"
        print(folded(begin, sys.stderr), file=sys.stderr, flush=True)
        try:
            bridge.run(arguments.duration)
        finally:
            print(as_json(ways) if arguments.json else folded("\n".join(lines(ways)), sys.stdout), flush=True)
    if signal.SIGINT in came:
        raise KeyboardInterrupt
    return 0


def lines(ways: list[Way]) -> Iterator[str]:
    for way in ways:
        yield f"{way.source.name} to {way.to.name}: {way.heard} heard, {way.sent} sent"
        if way.source.ear.missed:
            yield f"  {way.source.ear.missed} dropped by the kernel: this machine is too slow"
        if behind := _behind(way):
            yield f"  a user of the station fell behind {behind} times; its losses are not in these counts"
        if unheard := _unheard(way):
            yield f"  {unheard} refused: no program listens at the address"
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
    """Return the number of times that the station reported a user, such as this program, as too slow."""
    return way.source.ear.fell_behind() if isinstance(way.source.ear, ears.StationEar) else 0


def _unheard(way: Way) -> int:
    """Return the number of datagrams that the other side rejected."""
    return way.to.end.unheard if isinstance(way.to.end, ends.Datagrams) else 0


# -- sides of the link, as the command line gives them


class Named(NamedTuple):
    """Side given on the command line.

    name     its text.
    hears    address or device at which it receives.
    sends    address or device to which it sends.
    opening  function that opens it.
    """

    name: str
    hears: object
    sends: object
    opening: Opening


def _check(a: Named, b: Named) -> None:
    """Check for a loop. Raises UsageError if a side would receive what this program sends."""
    ways = [(one, other) for one in (a, b) for other in (a, b) if isinstance(one.hears, Address)]
    for one, other in ways or [(a, b)]:
        if _is_heard(other.sends, one.hears):
            raise UsageError(
                f"{one.name} would receive messages that this program sends to {other.name}",
                "in udp:LISTEN,PEER the station sends to LISTEN, and listens at PEER",
            )


def _is_heard(sent_to: object, at: object) -> bool:
    if not isinstance(sent_to, Address) or not isinstance(at, Address) or at.host != "0.0.0.0":
        return sent_to == at
    return sent_to.port == at.port and _is_here(sent_to.host)


def _is_here(host: str) -> bool:
    """Whether an address belongs to this machine or is a multicast group: the kernel binds to no other."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind((host, 0))
        except OSError:
            return False
    return True


def side(text: str) -> Named:
    """Parse a side.

    Raises ArgumentTypeError for a kind other than udp, ethernet and station, and for an invalid address.
    """
    kind, _, rest = text.partition(":")
    make = {"udp": _udp, "ethernet": _ethernet, "station": _station}.get(kind)
    if make is None or not rest:
        raise argparse.ArgumentTypeError(
            f"{text!r}: invalid side; write udp:LISTEN,PEER, ethernet:DEVICE or station:HOST[:PORT]"
        )
    return Named(text, *make(rest))


def _udp(text: str) -> tuple[object, object, Opening]:
    try:
        listen, peer = (udp_address(f"{HOST}{part}" if part.startswith(":") else part) for part in text.split(","))
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(f"udp:{text}: {error.message}") from error
    except ValueError:
        raise argparse.ArgumentTypeError(f"udp:{text}: not LISTEN,PEER; for example udp::9001,10.0.0.2:8947") from None

    def opening(arguments: argparse.Namespace, ending: ExitStack) -> tuple[ears.Ear, ends.End]:
        ear, end = ears.Datagrams(listen, arguments.framing), ends.Datagrams(peer, arguments.framing)
        ending.callback(ear.close)
        ending.callback(end.close)
        return ear, end

    return listen, peer, opening


def _ethernet(device: str) -> tuple[object, object, Opening]:
    def opening(_arguments: argparse.Namespace, ending: ExitStack) -> tuple[ears.Ear, ends.End]:
        ear, end = ears.DeviceEar(device), ends.DeviceEnd(device)
        ending.callback(ear.close)
        ending.callback(end.close)
        return ear, end

    return device, device, opening


def _station(text: str) -> tuple[object, object, Opening]:
    host, first = station(text)
    place = client.Address(host, first, first + 1, first + 2, first + 3)

    def opening(_arguments: argparse.Namespace, ending: ExitStack) -> tuple[ears.Ear, ends.End]:
        context = ending.enter_context(client.session())
        ear, end = ears.StationEar(context, place), ends.Pull(context, place)
        ending.callback(ear.close)
        ending.callback(end.close)
        return ear, end

    return place, place, opening
