"""captain lab: tests ten messages between two stations, with a capture of every frame."""

import argparse
import json
import math
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import zmq

from board.runtime.errors import StationError, UsageError
from firmware import file_remedy, topics
from firmware.client.arguments import HIGHEST_RATE, number, seconds
from firmware.client.show.table import Screen, Table
from firmware.lab import dissection, ways
from firmware.lab.copies import Count
from firmware.lab.dissection import Dissected
from firmware.lab.laboratory import Bench, Link, NamespaceDevice, bench, vectors
from firmware.lab.pcap import Pcap
from firmware.lab.ways import Way

DESCRIPTION = """\
Starts two stations, A and B, and a user's program at each. Both users send ten
messages: DENM, CAM, MAPEM, SPATEM, IVIM, CPM of several origins. They count
which of the other's messages arrive unchanged, altered or not at all. At the
end two more messages go each way once. Nothing leaves this machine.

The stations hear each other by one of these links:

  (default)   Ethernet frames in UDP datagrams
  --veth      raw Ethernet between two network namespaces; without root if the
              kernel lets users create namespaces
  --radio     simulated SOM301-E radios, whose air may lose messages: exactly
              those must be missing
  --devices   two network devices of this machine that hear each other, each in
              a network namespace of its own
  --mqtt      a broker, mosquitto, started with TLS and new certificates
  --radio --mqtt
              both: each message must be delivered once, whatever the air
              loses; the result has the interface that was first
"""
EPILOG = """\
examples:
  captain lab                               60 s at 10 Hz over UDP
  captain lab --veth --duration 10          over raw Ethernet
  captain lab --radio 0.1 --short           by radio, the air loses a tenth
  captain lab --devices a:wlan0 b:wlan1     between two 802.11p cards
  captain lab --mqtt                        by a broker
  captain lab --radio 0.1 --mqtt            by radio and broker
  captain lab --capture lab.pcap --decode   and decode every frame by tshark

exit codes:
  0    no message was lost but by the air, altered, or delivered twice; with
       --decode, tshark decoded every frame without an error
  1    otherwise, or a station could not start
  2    wrong usage
"""
SHORT_S = 2.0
QUIET_S = 2.0  # seconds after the last arrival; later messages count as lost
REDRAW_S = 0.5
HEADS = ("message", "from", ">sent", ">received", ">equal", ">altered", ">lost")


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--duration", metavar="S", type=seconds, default=60.0, help="send for S seconds (default 60)")
    parser.add_argument("--short", action="store_const", const=SHORT_S, dest="duration", help=f"send for {SHORT_S:g} s")
    parser.add_argument(
        "--rate",
        metavar="HZ",
        type=number("messages per second", HIGHEST_RATE),
        default=10.0,
        help="rate of each message (default 10)",
    )
    links = parser.add_mutually_exclusive_group()
    links.add_argument("--veth", action="store_true", help="raw Ethernet between two network namespaces")
    links.add_argument(
        "--radio",
        metavar="LOSS",
        nargs="?",
        const=0.0,
        type=number("losses per message", 1.0, is_zero_allowed=True),
        help="simulated SOM301-E radios, whose air loses this share (default 0)",
    )
    links.add_argument(
        "--devices",
        metavar="NETNS:DEVICE",
        nargs=2,
        type=_device,
        default=(),
        help="raw Ethernet on two devices, each in a namespace of `ip netns` (as root)",
    )
    parser.add_argument("--mqtt", action="store_true", help="a broker, with --radio in addition to the radios")
    parser.add_argument("--capture", metavar="FILE", type=Path, help="write every frame to a pcap file")
    parser.add_argument("--decode", action="store_true", help="decode every frame of the capture by tshark")
    parser.add_argument("--json", action="store_true", help="one JSON object in place of tables")


def _device(text: str) -> NamespaceDevice:
    namespace, colon, name = text.partition(":")
    if not (colon and namespace and name):
        raise argparse.ArgumentTypeError(f"{text!r}: not NETNS:DEVICE; for example a:wlan0")
    return NamespaceDevice(namespace, name)


def main(arguments: argparse.Namespace) -> int:
    """Run the laboratory and print its result.

    Raises UsageError for options that exclude each other, StationError if the capture cannot be written.
    """
    _check(arguments)
    with ExitStack() as ending:
        path = arguments.capture
        if path is None and arguments.decode:
            folder = ending.enter_context(tempfile.TemporaryDirectory(prefix="captain-lab-"))
            path = Path(folder) / "lab.pcap"
        count, found = _run(arguments, path, ending)
        rows = dissection.dissect(path) if arguments.decode else []
    result = Result(count, rows, arguments.decode, found)
    print(json.dumps(result.as_json(arguments)) if arguments.json else "\n".join(result.lines(arguments)))
    return 0 if result.is_good else 1


def _check(arguments: argparse.Namespace) -> None:
    """Check the combination of options. Raises UsageError."""
    if arguments.mqtt and (arguments.veth or arguments.devices):
        raise UsageError(
            "--mqtt: not with --veth or --devices, whose network namespaces do not reach the broker",
            "use --radio, or UDP",
        )
    if arguments.mqtt and arguments.radio is None and (arguments.capture or arguments.decode):
        raise UsageError("--mqtt: no frames to capture, because of TLS", "add --radio, or omit --capture and --decode")


def _run(arguments: argparse.Namespace, path: Path | None, ending: ExitStack) -> tuple[Count, Sequence[Way]]:
    capture = None
    if path is not None:
        try:
            capture = Pcap(path)
        except OSError as error:
            raise StationError(f"--capture: {path}: {error.strerror}", file_remedy.to_write(error)) from error
        ending.callback(capture.close)
    laboratory = bench(_link(arguments), arguments.radio or 0.0, capture, arguments.devices, arguments.mqtt)
    found: list[Way] = []
    with laboratory as made, Screen(sys.stderr) as screen:
        count = Count(vectors(), [seat.name for seat in made.seats])
        test = Test(made, count, screen if screen.is_terminal and not arguments.json else None)
        test.run(round(arguments.duration * arguments.rate), 1.0 / arguments.rate)
        if _has_two_ways(arguments):
            for seat, other, control in zip(made.seats, reversed(made.seats), made.controls, strict=True):
                found += ways.ways(seat.name, control, count.received_from(other.name))
            made.recorder.record()  # frames of the air may arrive later than messages of the broker
        else:
            count.lost_on_air = made.lost_on_air()
    if capture is not None:
        capture.close()
        count.recorded = capture.frames
    return count, found


def _has_two_ways(arguments: argparse.Namespace) -> bool:
    return arguments.mqtt and arguments.radio is not None


def _link(arguments: argparse.Namespace) -> Link:
    if arguments.veth:
        return "veth"
    if arguments.devices:
        return "devices"
    if arguments.radio is not None:
        return "radio"
    return "none" if arguments.mqtt else "udp"


def _name(arguments: argparse.Namespace) -> str:
    """Return the names of all links between the stations."""
    link = _link(arguments)
    return "+".join([link] * (link != "none") + ["mqtt"] * arguments.mqtt)


class Test:
    """Sends, receives and records in one loop, until all messages have arrived or none arrives for QUIET_S."""

    def __init__(self, made: Bench, count: Count, screen: Screen | None) -> None:
        self._seats = made.seats
        self._recorder = made.recorder
        self._count = count
        self._screen = screen
        self._redraw = 0.0
        self._poller = zmq.Poller()
        for seat in made.seats:
            self._poller.register(seat.subscriber, zmq.POLLIN)
            self._poller.register(seat.station, zmq.POLLIN)
        self._poller.register(made.recorder, zmq.POLLIN)

    def run(self, times: int, period: float) -> None:
        """Send each of the ten messages `times` times, spread over each period in seconds; send the others once."""
        ten = [place for place, vector in enumerate(self._count.vectors) if not vector.is_beside]
        start = time.monotonic()
        for turn in range(times * len(ten)):
            self._serve_until(start + turn * period / len(ten))
            self._send(ten[turn % len(ten)])
        self._collect()
        for place, vector in enumerate(self._count.vectors):
            if vector.is_beside:
                self._send(place)
        self._collect()

    def _send(self, place: int) -> None:
        for seat in self._seats:
            seat.send(self._count.vectors[place])
            self._count.sent(seat.name, place)

    def _collect(self) -> None:
        """Receive until all messages have arrived, or none has for QUIET_S."""
        last, missing = time.monotonic(), self._count.missing
        while missing > 0 and time.monotonic() < last + QUIET_S:
            self._serve_until(time.monotonic() + QUIET_S, once=True)
            if self._count.missing < missing:
                last, missing = time.monotonic(), self._count.missing
        self._recorder.record()

    def _serve_until(self, when: float, once: bool = False) -> None:
        while True:
            now = time.monotonic()
            events = self._poller.poll(math.ceil(max(0.0, when - now) * 1000))
            for seat, sender in zip(self._seats, reversed(self._seats), strict=True):
                for message in seat.receive():
                    self._count.received(sender.name, message)
                seat.station.check()
            self._recorder.record()
            if self._screen is not None and now > self._redraw:
                self._redraw = now + REDRAW_S
                self._screen.show([table(self._count)])
            if not events or once:
                return


class Result(NamedTuple):
    """Result of the lab test.

    counted     counts of messages.
    dissected   counts of frames by tshark.
    is_decoded  frames were decoded by tshark.
    ways        counts by interface, if the stations had two.
    """

    counted: Count
    dissected: Sequence[Dissected]
    is_decoded: bool
    ways: Sequence[Way] = ()

    @property
    def is_good(self) -> bool:
        return not (self.lost - self.counted.lost_on_air or self.altered) and (
            not self.is_decoded or self.is_well_formed
        )

    @property
    def lost(self) -> int:
        return sum(row.lost for row in self.counted.rows())

    @property
    def altered(self) -> int:
        return self.counted.strange + sum(row.altered for row in self.counted.rows())

    @property
    def is_well_formed(self) -> bool:
        """Whether tshark decoded every frame without error; it need not know the messages beside the ten."""
        ports = {row.name: row.standard for row in topics.ROWS}
        beside: Counter[int | None] = Counter()
        for row in self.counted.rows():
            beside[ports[row.vector.type]] += row.sent * row.vector.is_beside
        messages = [row for row in self.dissected if row.port]
        return (
            not any(row.malformed for row in self.dissected)
            and all(row.btp <= beside[row.port] for row in messages)
            and sum(row.frames for row in messages) == sum(row.sent for row in self.counted.rows())
        )

    def lines(self, arguments: argparse.Namespace) -> Iterator[str]:
        from firmware.client.show.table import plain, width_of

        width = width_of(sys.stdout)
        yield from plain(table(self.counted), width)
        if arguments.capture:
            yield ""
            yield f"{self.counted.recorded} frames in {arguments.capture}"
        if self.ways:
            yield ""
            yield from plain(ways.table(self.ways), width)
        if self.is_decoded:
            yield ""
            yield from plain(decoded_table(self.dissected), width)
        yield ""
        on_air = f" ({self.counted.lost_on_air} of them by the air)" if self.counted.lost_on_air else ""
        yield f"{self.lost} lost{on_air}, {self.altered} altered"

    def as_json(self, arguments: argparse.Namespace) -> dict[str, object]:
        return {
            "link": _name(arguments),
            "duration_s": arguments.duration,
            "rate_hz": arguments.rate,
            "messages": [
                {
                    "type": row.vector.type,
                    "octets": len(row.vector.pdu),
                    "from": row.sender,
                    "sent": row.sent,
                    "received": row.received,
                    "equal": row.equal,
                    "altered": row.altered,
                    "lost": row.lost,
                }
                for row in self.counted.rows()
            ],
            "lost": self.lost,
            "lost_on_air": self.counted.lost_on_air,
            "altered": self.altered,
            "frames": self.counted.recorded,
            "ways": [way._asdict() for way in self.ways],
            "decoded": [row._asdict() for row in self.dissected],
        }


def table(count: Count) -> Table:
    rows = [
        [row.vector.name, row.sender, *(str(n) for n in (row.sent, row.received, row.equal, row.altered, row.lost))]
        for row in count.rows()
    ]
    notes = [f"{count.strange} other messages received"] if count.strange else []
    return Table("Messages by type and octets; what A sends, B receives", HEADS, rows, notes)


def decoded_table(rows: Sequence[Dissected]) -> Table:
    heads = (">BTP port", ">frames", ">to the ITS message", ">to BTP", ">malformed")
    cells = [[str(row.port or dissection.BEACON), *(str(number) for number in row[1:])] for row in rows]
    return Table("Every frame of the capture, as far as tshark decodes it", heads, cells)
