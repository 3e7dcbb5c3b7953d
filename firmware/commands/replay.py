"""captain replay: what was recorded, sent again: to a station's endpoint, or as frames to a link."""

import argparse
import io
import json
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import asdict

from board.address import Address
from board.address import address as udp_address
from board.errors import ConfigurationError, RequestError, UsageError
from drivers.wire.impairment import Impairment
from firmware.codec.reading import FORMS, Pdu
from firmware.printable import clean
from firmware.replay.arguments import add_impairments, impairments, told
from firmware.replay.ending import until_sigterm
from firmware.replay.ends import Datagrams, Device, End, Station, Users, station_lines
from firmware.replay.player import Played, Player
from firmware.replay.rewriting import Changes, Rewriting
from firmware.replay.source import Choice, Source
from firmware.replay.timing import Timing
from firmware.user import client
from firmware.user.arguments import HIGHEST_RATE, add_station, address, finite, integer, number, times
from firmware.user.failures import Failures

DESCRIPTION = """\
Sends again what was recorded, as fast as it was recorded: by default its PDUs
to a station's PULL socket, which confirms each; with --udp or --ethernet whole
frames to where a station hears them, as another station's radio would.

WHAT is anything that `captain decode` reads: captures (pcap, pcapng) of this
program, of Wireshark, tcpdump or other tools, MCAP of `captain record` and of
the gateway to ROS 2, lists of hexadecimal or base64 (a message a line), JSON, a
folder of these, or - for standard input. What has no time is sent 10 times a
second. To a link go beacons and broken frames as well, as they are; a PDU that
came in no frame gets one. What is left out is told, and why.
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
                                          ten rounds, and a tenth of it is lost
  captain record --pcapng - | captain replay - --udp 10.0.0.2:8947
                                          what one station hears, another hears

exit codes:
  0    everything was read, or SIGTERM, and sent (by a station: by at least one
       interface)
  1    something was not, nobody listened, or no station answers
  2    wrong usage
  130  Ctrl-C
"""
FRAMINGS = ("ethernet", "btp", "pdu")


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", metavar="WHAT", nargs="*", help="a file, a folder, the message itself, or -")
    parser.add_argument("--form", choices=FORMS, help="how to read WHAT, whatever it looks like")
    parser.add_argument(
        "--direction",
        choices=("in", "out", "both"),
        default="in",
        help="of a recording that says it: what the station had received (the default), what it had sent, or both",
    )
    parser.add_argument(
        "--interface", metavar="I", action="append", default=[], help="of a recording that says it; may be repeated"
    )
    _add_ends(parser)
    pace = parser.add_argument_group("when")
    speed = pace.add_mutually_exclusive_group()
    speed.add_argument("--speed", metavar="X", type=number("times", 1e6), default=1.0, help="X times as fast")
    speed.add_argument(
        "--rate", metavar="R", type=number("messages a second", HIGHEST_RATE, is_zero_allowed=True),
        help="messages per second, whatever was recorded; 0: as fast as they go",
    )  # fmt: skip
    seconds = number("seconds", 1e9, is_zero_allowed=True)
    pace.add_argument(
        "--from", dest="from_s", metavar="S", type=seconds, default=0.0, help="leave out the first S seconds"
    )
    pace.add_argument("--to", dest="to_s", metavar="S", type=seconds, help="leave out what is later than second S")
    pace.add_argument(
        "--loop", metavar="N", nargs="?", type=times, const=0, default=1, help="N rounds; without N, until Ctrl-C"
    )
    pace.add_argument(
        "--longest-gap", metavar="S", type=seconds, default=60.0, help="longer silence is cut to it (default 60)"
    )
    changed = parser.add_argument_group("what becomes another (what is signed or does not decode is left out then)")
    changed.add_argument(
        "--station-id", metavar="[+]N", type=_station_id, default=(None, False), help="of all messages; +N adds to each"
    )
    changed.add_argument(
        "--time", choices=("now",), help="move generation and reference times as far as the replay is later"
    )
    changed.add_argument(
        "--shift", metavar="NORTH,EAST", type=_shift, default=(0.0, 0.0), help="move every place so many metres"
    )
    add_impairments(parser)
    parser.add_argument("--json", action="store_true", help="the summary as one JSON object")


def _add_ends(parser: argparse.ArgumentParser) -> None:
    add_station(parser)
    end = parser.add_argument_group("where to, if not the station's PULL").add_mutually_exclusive_group()
    end.add_argument("--publish", action="store_true", help="the station's SUB (5555): nothing is confirmed")
    end.add_argument("--udp", metavar="HOST:PORT", type=_udp, help="datagrams to a peer or a multicast group")
    end.add_argument("--ethernet", metavar="DEVICE", help="frames by a network device")
    parser.add_argument("--framing", choices=FRAMINGS, help=f"of the datagrams (default {FRAMINGS[0]})")


def main(arguments: argparse.Namespace) -> int:
    what = arguments.what or ["-"]
    if "-" in what and arguments.loop != 1:
        raise UsageError("--loop: standard input is read once", "name a file")
    if arguments.to_s is not None and arguments.to_s <= arguments.from_s:
        raise UsageError(f"--to {arguments.to_s:g} is not after --from {arguments.from_s:g}", "both are seconds")
    if arguments.framing is not None and arguments.udp is None:
        raise UsageError(f"--framing {arguments.framing}: only datagrams have one", "--udp HOST:PORT sends datagrams")
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

        def tell(error: RequestError) -> None:
            # Everywhere else --from is the option of the form; here it is a time.
            failures.tell(RequestError(error.message, error.hint.replace("--from", "--form")))

        player = Player(end, way, rewriting, timing, tell)
        began = time.monotonic()
        try:
            with until_sigterm(), failures:
                for _ in _rounds(arguments.loop):
                    before = way.counts.taken
                    for _ in player.play(source.items(what)):
                        pass
                    if way.counts.taken == before:
                        break  # nothing of it goes: without an end this would go on in silence
                player.finish()
            if isinstance(end, Station):
                end.finish()
        finally:
            if isinstance(end, Station):
                end.close()
            told_in = sys.stdout if arguments.json else sys.stderr
            summary = Summary(player.played, way, source, end, time.monotonic() - began)
            print(summary.json() if arguments.json else "\n".join(summary.lines()), file=told_in, flush=True)
    return 0 if player.played.is_good and _is_good(end) else 1


def _is_good(end: End) -> bool:
    """Whether it has gone to somebody, as far as the end knows."""
    match end:
        case Station():
            return end.is_good
        case Datagrams():
            return not end.unheard
        case _:
            return True


def _rounds(count: int) -> Iterator[int]:
    done = 0
    while not count or done < count:
        done += 1
        yield done


def _end(arguments: argparse.Namespace, ending: ExitStack) -> End:
    """Where it goes."""
    if arguments.udp is not None:
        datagrams = Datagrams(arguments.udp, arguments.framing or FRAMINGS[0])
        ending.callback(datagrams.close)
        return datagrams
    if arguments.ethernet is not None:
        device = Device(arguments.ethernet)
        ending.callback(device.close)
        return device
    place = address(arguments)
    context = ending.enter_context(client.session())
    if arguments.publish:
        users = Users(context, place)
        ending.callback(users.close)
        return users
    return Station(context, place, "replay", is_paced=arguments.rate != 0)


class Summary:
    """What became of it all."""

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
        self._station = end if isinstance(end, Station) else None
        self._unheard = end.unheard if isinstance(end, Datagrams) else 0
        self._seconds = seconds

    def lines(self) -> Iterator[str]:
        played = self._played
        yield f"captain: {played.sent} sent of {played.read} read in {self._seconds:.1f} s"
        if self._station is not None:
            yield from (clean(f"captain: {line}") for line in station_lines(self._station))
        if self._unheard:
            yield f"captain: nobody listened to {self._unheard} of them"
        if way := told(self._way.counts):
            yield f"captain: the way, {way}"
        if played.gaps_cut:
            yield f"captain: {played.gaps_cut} gaps were cut: longer than --longest-gap, or its clock was set"
        if played.unreadable:
            yield f"captain: {played.unreadable} could not be read"
        for title, tally in (("left out", played.left_out), ("not sent", played.unsent)):
            for why, count in sorted(tally.items()):
                where = f" (first {played.examples[why]})" if why in played.examples else ""
                yield clean(f"captain: {title}: {count}: {why}{where}")
        for what, count in sorted(self._skipped.items()):
            yield clean(f"captain: left out: {count} {what}")

    def json(self) -> str:
        played = self._played
        return json.dumps(
            {
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


# -- values


def _udp(text: str) -> Address:
    try:
        return udp_address(text)
    except ConfigurationError as error:
        raise argparse.ArgumentTypeError(error.message) from error


def _station_id(text: str) -> tuple[int, bool]:
    return integer(0, 0xFFFFFFFF)(text.removeprefix("+")), text.startswith("+")


def _shift(text: str) -> tuple[float, float]:
    north, comma, east = text.partition(",")
    values = finite(north), finite(east)
    if not comma or values[0] is None or values[1] is None or max(map(abs, (values[0], values[1]))) > 1e7:
        raise argparse.ArgumentTypeError(f"{text!r} is no NORTH,EAST in metres: 0,500 or -20.5,100")
    return values[0], values[1]
