"""captain replay: sends recordings again, to a station or as frames on a link."""

import argparse
import io
import json
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict

from board.runtime.errors import StationError, UsageError
from drivers.wire.impairment import Impairment
from firmware.client import client
from firmware.client.arguments import HIGHEST_RATE, add_station, address, finite, integer, number, times, udp_address
from firmware.client.show.failures import Failures
from firmware.codec.arguments import add_format
from firmware.codec.reading import Pdu
from firmware.printable import clean, failure_record, folded
from firmware.replay.arguments import add_impairments, impairments, told
from firmware.replay.ending import until_sigterm
from firmware.replay.ends import Datagrams, DeviceEnd, End, StationEnd, Users, station_lines, unsent
from firmware.replay.player import Played, Player
from firmware.replay.rewriting import Changes, Rewriting
from firmware.replay.source import Choice, Source
from firmware.replay.timing import Timing

DESCRIPTION = """\
Sends recorded messages again, at their recorded times. By default the PDUs go
to a station's PULL socket, and the station confirms each. With --udp or
--ethernet whole frames go to a receiver, as from another station's radio.

The input is everything that `captain decode` reads:

  pcap, pcapng   of this program, Wireshark, tcpdump and others
  MCAP           of `captain record` and of the gateway to ROS 2
  text           a message a line, hexadecimal or base64
  JSON           an object a line

It may be a folder of these, or - for standard input. Messages without a time
are sent 10 times a second. Beacons and broken frames go to a link unchanged; a
PDU without a frame gets one. The summary counts messages that were left out,
with the reason.
"""
EPILOG = """\
examples:
  captain replay drive.pcapng             into the station of this machine
  captain replay drive.pcapng --udp 127.0.0.1:8947
                                          as frames to its `udp` interface
  captain replay drive.pcapng --ethernet wlan0 --speed 2
                                          by 802.11p, twice as fast
  captain replay drive.pcapng --time now --station-id 4711 --shift 0,500
                                          another station, now, 500 m east
  captain replay cams.hex --rate 100 --loop 10 --loss 0.1 --seed 7
                                          ten rounds, a tenth is lost
  captain record --pcapng - | captain replay - --udp 10.0.0.2:8947
                                          one station hears, another one too

exit codes:
  0    all was read and sent, or SIGTERM; a station sent each message by at
       least one interface
  1    a message was not sent, no receiver listened, or no station answers
  2    wrong usage
  130  Ctrl-C
"""
FRAMINGS = ("ethernet", "btp", "pdu")


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", metavar="WHAT", nargs="*", help="a file, a folder, the message itself, or -")
    add_format(parser)
    parser.add_argument(
        "--direction",
        choices=("in", "out", "both"),
        default="in",
        help="messages that the station had received (default), sent, or both; for recordings of captain record",
    )
    parser.add_argument(
        "--interface",
        metavar="I",
        action="append",
        default=[],
        help="messages of this interface; may be repeated; for recordings of captain record",
    )
    _add_ends(parser)
    pace = parser.add_argument_group("times")
    speed = pace.add_mutually_exclusive_group()
    speed.add_argument(
        "--speed", metavar="X", type=number("times", 1e6), default=1.0, help="X times as fast as recorded"
    )
    speed.add_argument(
        "--rate", metavar="R", type=number("messages per second", HIGHEST_RATE, is_zero_allowed=True),
        help="messages per second, in place of the recorded times; 0: as fast as possible",
    )  # fmt: skip
    seconds = number("seconds", 1e9, is_zero_allowed=True)
    pace.add_argument("--from", dest="from_s", metavar="S", type=seconds, default=0.0, help="omit the first S seconds")
    pace.add_argument("--to", dest="to_s", metavar="S", type=seconds, help="omit everything after second S")
    pace.add_argument(
        "--loop", metavar="N", nargs="?", type=times, const=0, default=1, help="N rounds; without N, until Ctrl-C"
    )
    pace.add_argument(
        "--longest-gap", metavar="S", type=seconds, default=60.0, help="shorten longer silence to S (default 60)"
    )
    changed = parser.add_argument_group("changes (omit signed messages, and those that do not decode)")
    changed.add_argument(
        "--station-id",
        metavar="[+]N",
        type=_station_id,
        default=(None, False),
        help="stationID of all messages; +N adds to each",
    )
    changed.add_argument(
        "--time", choices=("now",), help="move generation and reference times to the time of the replay"
    )
    changed.add_argument(
        "--shift", metavar="NORTH,EAST", type=_shift, default=(0.0, 0.0), help="move every place by metres"
    )
    add_impairments(parser)
    parser.add_argument(
        "--json", action="store_true", help="the summary as one JSON object, with error and hint at exit code 1"
    )


def _add_ends(parser: argparse.ArgumentParser) -> None:
    add_station(parser)
    end = parser.add_argument_group("destination (default: the station's PULL)").add_mutually_exclusive_group()
    end.add_argument("--publish", action="store_true", help="the station's SUB (5555), without confirms")
    end.add_argument(
        "--udp", metavar="HOST:PORT", type=udp_address, help="send datagrams to a peer or a multicast group"
    )
    end.add_argument("--ethernet", metavar="DEVICE", help="send frames by a network device")
    parser.add_argument("--framing", choices=FRAMINGS, help=f"content of the datagrams (default {FRAMINGS[0]})")


def main(arguments: argparse.Namespace) -> int:
    """Replay recordings to a station, a peer or a device.

    Raises UsageError for --loop of standard input, for --to before --from, and for --framing without --udp. Raises
    StationError with the first reason if a message was not sent or not received, after the summary.
    """
    what = arguments.what or ["-"]
    if "-" in what and arguments.loop != 1:
        raise UsageError("--loop: standard input can be read only once", "name a file")
    if arguments.to_s is not None and arguments.to_s <= arguments.from_s:
        raise UsageError(
            f"--to {arguments.to_s:g} is not after --from {arguments.from_s:g}",
            "both count seconds from the first message",
        )
    if arguments.framing is not None and arguments.udp is None:
        raise UsageError(f"--framing {arguments.framing}: only for datagrams", "add --udp HOST:PORT")
    is_link = arguments.udp is not None or arguments.ethernet is not None
    choice = Choice(arguments.direction, frozenset(arguments.interface), has_dropped=is_link)
    source = Source(arguments.form, choice, io.BytesIO() if sys.stdin is None else sys.stdin.buffer)
    timing = Timing(arguments.speed, arguments.rate, arguments.from_s, arguments.to_s, arguments.longest_gap)
    station_id, is_added = arguments.station_id
    rewriting = Rewriting(Changes(station_id, is_added, arguments.time == "now", *arguments.shift))
    way = Impairment[Pdu](impairments(arguments))
    with ExitStack() as ending:
        end = _end(arguments, ending)
        failures = Failures()

        player = Player(end, way, rewriting, timing, failures.report)
        began = time.monotonic()
        try:
            with until_sigterm(), failures:
                for _ in _rounds(arguments.loop):
                    before = way.counts.taken
                    for _ in player.play(source.items(what)):
                        pass
                    if way.counts.taken == before:
                        break  # no message of this round was sent, so --loop would never end
                player.finish()
            if isinstance(end, StationEnd):
                end.finish()
        finally:
            if isinstance(end, StationEnd):
                end.close()
            summary = Summary(player.played, way, source, end, time.monotonic() - began)
            if arguments.json:
                print(summary.json(), flush=True)
            elif player.played.read:
                print(folded("\n".join(summary.lines()), sys.stderr), file=sys.stderr, flush=True)
    if summary.cause is None:
        return 0
    if arguments.json or (player.played.unreadable and not player.played.read):
        return 1  # the error is printed already
    raise summary.cause


def _rounds(count: int) -> Iterator[int]:
    done = 0
    while not count or done < count:
        done += 1
        yield done


def _end(arguments: argparse.Namespace, ending: ExitStack) -> End:
    """Open the destination that the options name."""
    if arguments.udp is not None:
        datagrams = Datagrams(arguments.udp, arguments.framing or FRAMINGS[0])
        ending.callback(datagrams.close)
        return datagrams
    if arguments.ethernet is not None:
        device = DeviceEnd(arguments.ethernet)
        ending.callback(device.close)
        return device
    place = address(arguments)
    context = ending.enter_context(client.session())
    if arguments.publish:
        users = Users(context, place)
        ending.callback(users.close)
        return users
    return StationEnd(context, place, "replay", is_paced=arguments.rate != 0)


class Summary:
    """Summary of a replay."""

    def __init__(
        self,
        played: Played,
        way: Impairment[Pdu],
        source: Source,
        end: End,
        seconds: float,
    ) -> None:
        self._played = played
        self._way = way
        self._skipped = source.skipped
        self._end = end
        self._station = end if isinstance(end, StationEnd) else None
        self._unheard = end.unheard if isinstance(end, Datagrams) else 0
        self._seconds = seconds

    def lines(self) -> Iterator[str]:
        played = self._played
        yield f"captain: {played.sent} sent of {played.read} read in {self._seconds:.1f} s"
        if self._station is not None:
            yield from (clean(f"captain: {line}") for line in station_lines(self._station))
        if self._unheard:
            yield f"captain: {self._unheard} refused: no program listens at the address"
        if way := told(self._way.counts):
            yield f"captain: lossy link: {way}"
        if played.gaps_cut:
            yield f"captain: {played.gaps_cut} gaps shortened: longer than --longest-gap, or the clock was set"
        if played.unreadable:
            yield f"captain: {played.unreadable} unreadable"
        for title, tally in (("left out", played.left_out), ("not sent", played.unsent)):
            for why, count in sorted(tally.items()):
                where = f" (first {played.examples[why]})" if why in played.examples else ""
                yield clean(f"captain: {title}: {count}: {why}{where}")
        for what, count in sorted(self._skipped.items()):
            yield clean(f"captain: left out: {count} {what}")

    @property
    def cause(self) -> StationError | None:
        """First reason for exit code 1; None for exit code 0."""
        return self._played.cause or unsent(self._end)

    def json(self) -> str:
        played = self._played
        return json.dumps(
            {
                **(failure_record(self.cause) if self.cause else {}),
                "read": played.read,
                "sent": played.sent,
                "seconds": self._seconds,
                "late_s": played.late_s,
                "gaps_cut": played.gaps_cut,
                "unreadable": played.unreadable,
                "left_out": dict(played.left_out),
                "skipped": dict(self._skipped),
                "unsent": dict(played.unsent),
                "unheard": self._unheard,
                "outcomes": self._station.outcomes if self._station is not None else {},
                "fates": dict(self._station.fates) if self._station is not None else {},
                "way": asdict(self._way.counts),
            }
        )


# -- parsers of options


def _station_id(text: str) -> tuple[int, bool]:
    return integer(0, 0xFFFFFFFF)(text.removeprefix("+")), text.startswith("+")


def _shift(text: str) -> tuple[float, float]:
    north, comma, east = text.partition(",")
    values = finite(north), finite(east)
    if not comma or values[0] is None or values[1] is None or max(map(abs, (values[0], values[1]))) > 1e7:
        raise argparse.ArgumentTypeError(f"{text!r}: not NORTH,EAST in metres; for example 0,500 or -20.5,100")
    return values[0], values[1]
