"""captain record: what a station hears and sends, into files that Wireshark reads, and what users get, for ROS 2."""

import argparse
import subprocess
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from board.errors import RequestError, StationError, UsageError
from firmware.codec.library import load
from firmware.recorder.ending import Ending
from firmware.recorder.hearing import say
from firmware.recorder.mcap_recording import Recording
from firmware.recorder.ring import Limits
from firmware.recorder.session import record
from firmware.recorder.sinks import File, Keeper, Pipe, Sink, output, standard_output
from firmware.recorder.triggers import ALL
from firmware.user import client
from firmware.user.arguments import add_control, address, integer, number
from firmware.user.listening import Listening, add_wish, wish_of

DESCRIPTION = """\
Records a station.

--pcapng, --live and --ring have every frame as it came or left, by each of the
station's interfaces, with what became of it: Wireshark, tshark and the tools of
this program read them. Interfaces that have no frames (SOM301-E, MQTT, UART,
bare PDUs) have theirs made up around the PDU, and say so. Comments and a custom
option tell signal strength, drop reasons, queue times, and how good the time is.

--mcap has what users receive, as messages of ROS 2 in its profile for ROS 2,
which `ros2 bag`, Foxglove and PlotJuggler read; it has been read back by
mcap-ros2-support, and not tried with them. The types are those of
etsi_its_messages where it has the edition. For each type there are two topics:

  cam/received            the message, of the type etsi_its_cam_msgs/msg/CAM
  cam/received/metadata   time, signal strength, positions, edition, and the
                          octets of the PDU as they came

What no edition of the message library takes is on the second topic alone. That
file is not compressed; one that was not closed, because the power failed, ends
within its last two seconds, and `mcap recover` mends it. A disk that is full
ends it as well.

--ring keeps the last octets and seconds in files of a folder, and what was
before an event under a name that says why: --on denm (a DENM that passed), loss
(ten frames lost within a second), gnss (time by pulses no more), or SIGUSR1. The
station does that by itself where captain.toml has [recorder]; --trigger tells
it to keep what was.

Of frames, a disk that is full or gone costs some, which are counted: recording
goes on when it is back. A cut of power costs the last second.
"""
EPILOG = """\
examples:
  captain record --pcapng drive.pcapng      everything, until Ctrl-C
  captain record --pcapng - | tshark -r -   while it comes
  captain record --live                     in Wireshark, while it comes
  captain record --ring /data/ring --size 512 --age 7200 --on denm
  captain record --trigger "near miss"      the station keeps what was before
  captain record --mcap minute.mcap --duration 60 --type cam --type denm
  captain record --pcapng far.pcapng --station 192.168.1.7
                                            of a station elsewhere

exit codes:
  0    the count or the duration is reached, SIGTERM, or a terminal that is gone
  1    no station answers, there is no message library, or a file cannot be
       written: some of what came is not in it
  2    wrong usage
  130  Ctrl-C; the file is whole
"""
OF_RING = ("size", "age", "on", "before", "after")
MOST_MB = 1 << 20
LONGEST_S = 30 * 86400.0


def arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--pcapng", metavar="FILE", help="frames, into a file that must not exist; `-`: standard output")
    what.add_argument("--mcap", metavar="FILE", type=Path, help="messages for ROS 2, likewise")
    what.add_argument("--live", action="store_true", help="frames, into a Wireshark that is started")
    what.add_argument("--ring", metavar="FOLDER", type=Path, help="frames, into a ring of files in a folder")
    what.add_argument("--trigger", metavar="TEXT", help="tell a station of this machine to keep what was, and why")
    ring = parser.add_argument_group("the ring")
    ring.add_argument("--size", metavar="MB", type=integer(1, MOST_MB), help="at most (256)")
    ring.add_argument("--age", metavar="S", type=_seconds, help="at most (3600)")
    ring.add_argument("--on", metavar="EVENT", action="append", choices=ALL, help="keep what was before (default: all)")
    ring.add_argument("--before", metavar="S", type=_seconds, help="kept of an event (30)")
    ring.add_argument("--after", metavar="S", type=_seconds, help="kept of an event (10)")
    add_wish(parser)
    add_control(parser)


_seconds = number("seconds", LONGEST_S)


def main(arguments: argparse.Namespace) -> int:
    for name in () if arguments.ring is not None else OF_RING:
        if (value := getattr(arguments, name)) is not None:
            said = value[0] if isinstance(value, list) else f"{value:g}"
            raise UsageError(f"--{name} {said}: only a ring has that", "--ring FOLDER makes one")
    if arguments.trigger is not None:
        return _trigger(arguments)
    if arguments.mcap is not None:
        return _mcap(arguments)
    if arguments.live:
        return _live(arguments)
    if arguments.ring is not None:
        return record(address(arguments), wish_of(arguments), lambda: _keeper(arguments), str(arguments.ring))
    make: Callable[[], Sink] = standard_output if arguments.pcapng == "-" else lambda: File(Path(arguments.pcapng))
    name = "standard output" if arguments.pcapng == "-" else arguments.pcapng
    return record(address(arguments), wish_of(arguments), make, name)


def _keeper(arguments: argparse.Namespace) -> Keeper:
    if not arguments.ring.is_dir():
        raise RequestError(f"{arguments.ring} is no folder", "make it: nobody else shall, where a card is missing")
    size = None if arguments.size is None else arguments.size << 20
    given = {"size": size, "age_s": arguments.age, "before_s": arguments.before, "after_s": arguments.after}
    limits = replace(Limits(), **{name: value for name, value in given.items() if value is not None})
    return Keeper(arguments.ring, limits, frozenset(arguments.on or ALL))


def _trigger(arguments: argparse.Namespace) -> int:
    answer = client.ask_local(address(arguments), arguments.control, "record", text=arguments.trigger)
    print(f"captain: the recorder is told; what it keeps: {answer.get('folder', '')}/kept-*")
    return 0


def _live(arguments: argparse.Namespace) -> int:
    """Into Wireshark's standard input; it ends when its window is closed."""
    try:
        shark = subprocess.Popen(["wireshark", "-k", "-i", "-"], stdin=subprocess.PIPE)
    except FileNotFoundError as error:
        raise StationError("the program wireshark is missing", "install the package wireshark") from error
    with shark:
        pipe = shark.stdin
        assert pipe is not None
        try:
            return record(address(arguments), wish_of(arguments), lambda: Pipe(pipe), "wireshark")
        except BrokenPipeError:
            return 0
        finally:
            with suppress(BrokenPipeError):
                pipe.close()


def _mcap(arguments: argparse.Namespace) -> int:
    try:
        _messages(arguments)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise RequestError(
            f"{arguments.mcap}: {error.strerror}", "what it holds until there, `mcap recover` makes whole"
        ) from error
    return 0


def _messages(arguments: argparse.Namespace) -> None:
    library = load()
    place = address(arguments)
    with (
        client.session() as context, _created(arguments.mcap) as stream, suppress(SystemExit), Ending() as ending,
    ):  # fmt: skip
        recording = Recording(stream, library)
        try:
            listening = Listening(client.subscribe(context, place, place.to_users, ""), place, wish_of(arguments))
            listening.on_heard = lambda: say(f"a station is heard at {place.host}:{place.to_users}")
            silence = Silence(listening)

            def idle() -> None:
                ending.check()
                silence.tell()
                recording.idle()

            for message in listening.messages(idle):
                recording.add(message)
                ending.check()
        except StationError:
            if not _is_standard_output(arguments.mcap):
                arguments.mcap.unlink(missing_ok=True)  # it is of no station
            raise
        finally:
            try:
                recording.close()
            finally:
                say(f"{arguments.mcap}: {recording.summary()}")


class Silence:
    """Says when a station falls silent, and when it is heard again."""

    def __init__(self, listening: Listening) -> None:
        self._listening = listening
        self._silent_s = 0.0

    def tell(self) -> None:
        before, self._silent_s = self._silent_s, self._listening.silent_s
        if self._silent_s and not before:
            say("the station is silent: nothing is recorded until it is heard again")
        elif before and not self._silent_s:
            say(f"the station is heard again, after {before:.0f} s")


def _is_standard_output(path: Path) -> bool:
    return str(path) == "-"


def _created(path: Path) -> AbstractContextManager[BinaryIO]:
    if _is_standard_output(path):
        return nullcontext(output("name a file, or send it through a pipe"))
    try:
        return path.open("xb")
    except FileExistsError:
        raise UsageError(f"--mcap: {path} is there already", "name another, or remove it") from None
    except OSError as error:
        raise RequestError(f"{path}: {error.strerror}", "does its folder exist, and may you write there?") from error
