"""captain record: records frames for Wireshark and messages for ROS 2."""

import argparse
import subprocess
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO

from board.runtime.errors import RequestError, StationError, UsageError
from firmware import file_remedy
from firmware.client import client
from firmware.client.arguments import add_control, address, integer, number
from firmware.client.listening import Listening, add_wish, wish_of
from firmware.client.received import Message, Pairing
from firmware.codec.library import load
from firmware.recorder.ending import Ending
from firmware.recorder.hearing import say
from firmware.recorder.mcap_recording import Recording
from firmware.recorder.ring import Limits
from firmware.recorder.session import record
from firmware.recorder.sinks import File, Keeper, Pipe, Sink, output, standard_output
from firmware.recorder.triggers import ALL

DESCRIPTION = """\
Records a station: its frames for Wireshark, or its messages for ROS 2.

--pcapng, --live and --ring record each frame as it came or left, with the
reason if it was dropped. Wireshark, tshark and the tools of this program read
them. Interfaces without frames (SOM301-E, MQTT, UART, bare PDUs) get made-up
headers around the PDU. The comment of a frame has signal strength, drop reason,
time in the queue, and accuracy of the time stamp.

--mcap records the messages that users receive, as messages of ROS 2 in its
profile for ROS 2. The types are those of etsi_its_messages where they have the
edition. Each message type has two topics:

  cam/received            the message, of type etsi_its_cam_msgs/msg/CAM
  cam/received/metadata   time, signal strength, positions, edition, and the
                          octets of the PDU

A message that does not decode is on the second topic only. The file is not
compressed. After a power failure it ends within its last two seconds, and
`mcap recover` repairs it. A full disk ends it. It was read back with
mcap-ros2-support; `ros2 bag`, Foxglove and PlotJuggler were not tried.

--ring keeps the last octets and seconds in files of a folder. At an event it
keeps the files of the seconds before and after. Events are: denm (a DENM
passed), loss (ten frames lost within a second), gnss (time no longer locked to
pulses), and SIGUSR1. The station runs a ring by itself if captain.toml has [recorder];
--trigger makes that one keep its files.

A full or removed disk costs frames, which are counted. Recording continues when
it is back. A power failure costs the last second.
"""
EPILOG = """\
examples:
  captain record --pcapng drive.pcapng      all frames, until Ctrl-C
  captain record --pcapng - | tshark -r -   print frames as they come
  captain record --live                     show them in Wireshark
  captain record --ring /data/ring --size 512 --age 7200 --on denm
  captain record --trigger "near miss"      the station keeps its last files
  captain record --mcap minute.mcap --duration 60 --type cam --type denm
  captain record --pcapng far.pcapng --station 192.168.1.7
                                            record a station elsewhere

exit codes:
  0    the count or the duration was reached, SIGTERM, or the terminal closed
  1    no station answers, the message library is missing, or frames could not
       be written
  2    wrong usage
  130  Ctrl-C; the file is complete
"""
OF_RING = ("size", "age", "on", "before", "after")
MOST_MB = 1 << 20
LONGEST_S = 30 * 86400.0


def arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--pcapng", metavar="FILE", help="record frames to a new file; `-`: standard output")
    what.add_argument("--mcap", metavar="FILE", type=Path, help="record messages for ROS 2 to a new file")
    what.add_argument("--live", action="store_true", help="start Wireshark and show frames in it")
    what.add_argument("--ring", metavar="FOLDER", type=Path, help="record frames to a ring of files in a folder")
    what.add_argument(
        "--trigger", metavar="TEXT", help="make the station of this machine keep its last files; TEXT is the reason"
    )
    ring = parser.add_argument_group("the ring")
    ring.add_argument("--size", metavar="MB", type=integer(1, MOST_MB), help="maximum size (default 256)")
    ring.add_argument("--age", metavar="S", type=_seconds, help="maximum age (default 3600)")
    ring.add_argument(
        "--on", metavar="EVENT", action="append", choices=ALL, help="event that keeps files (default: all)"
    )
    ring.add_argument("--before", metavar="S", type=_seconds, help="kept time before an event (default 30)")
    ring.add_argument("--after", metavar="S", type=_seconds, help="kept time after an event (default 10)")
    add_wish(parser)
    add_control(parser)


_seconds = number("seconds", LONGEST_S)


def main(arguments: argparse.Namespace) -> int:
    """Record a station in one of the four formats.

    Raises UsageError for options of a ring without --ring, RequestError if the MCAP file cannot be written,
    StationError without the program wireshark.
    """
    for name in () if arguments.ring is not None else OF_RING:
        if (value := getattr(arguments, name)) is not None:
            said = value[0] if isinstance(value, list) else f"{value:g}"
            raise UsageError(f"--{name} {said}: only a ring has this option", "add --ring FOLDER")
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
        raise RequestError(f"--ring: {arguments.ring}: not a folder", "create it, or mount the card that has it")
    size = None if arguments.size is None else arguments.size << 20
    given = {"size": size, "age_s": arguments.age, "before_s": arguments.before, "after_s": arguments.after}
    limits = replace(Limits(), **{name: value for name, value in given.items() if value is not None})
    return Keeper(arguments.ring, limits, frozenset(arguments.on or ALL))


def _trigger(arguments: argparse.Namespace) -> int:
    answer = client.ask_local(address(arguments), arguments.control, "record", text=arguments.trigger)
    print(f"captain: the recorder keeps {answer.get('folder', '')}/kept-*")
    return 0


def _live(arguments: argparse.Namespace) -> int:
    """Record to Wireshark's standard input until its window is closed.

    Raises StationError without the program wireshark.
    """
    try:
        shark = subprocess.Popen(["wireshark", "-k", "-i", "-"], stdin=subprocess.PIPE)
    except FileNotFoundError as error:
        raise StationError("wireshark: command not found", "install the package wireshark") from error
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
        raise RequestError(f"{arguments.mcap}: {error.strerror}", "`mcap recover` repairs the file") from error
    return 0


def _messages(arguments: argparse.Namespace) -> None:
    library = load()
    place = address(arguments)
    with (
        client.session() as context, _created(arguments.mcap) as stream, suppress(SystemExit), Ending() as ending,
    ):  # fmt: skip
        recording = Recording(stream, library)
        try:
            subscriber = client.subscribe(context, place, place.to_users, "")
            listening = Listening(subscriber, f"{place.host}:{place.to_users}", wish_of(arguments), Pairing())
            listening.on_heard = lambda: say(f"a station is heard at {listening.address}")
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
                arguments.mcap.unlink(missing_ok=True)  # the file is empty
            raise
        finally:
            try:
                recording.close()
            finally:
                say(f"{arguments.mcap}: {recording.summary()}")


class Silence:
    """Prints a note when the station falls silent, and when it is heard again."""

    def __init__(self, listening: Listening[Message]) -> None:
        self._listening = listening
        self._silent_s = 0.0

    def tell(self) -> None:
        before, self._silent_s = self._silent_s, self._listening.silent_s
        if self._silent_s and not before:
            say("the station is silent; recording continues when it is heard again")
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
        raise UsageError(f"--mcap: {path}: the file exists", "name another file, or remove it") from None
    except OSError as error:
        raise RequestError(f"{path}: {error.strerror}", file_remedy.to_write(error)) from error
