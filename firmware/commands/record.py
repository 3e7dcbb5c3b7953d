"""captain record: what a station's users receive, into a file of the form that the tools of ROS 2 read, MCAP."""

import argparse
import re
import signal
import sys
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import BinaryIO, NamedTuple, Self

from board.errors import RequestError, UsageError
from firmware import VERSION
from firmware.codec import library as library_
from firmware.codec import ros2
from firmware.codec.decoding import Decoder
from firmware.codec.identify import Identity
from firmware.codec.library import Library, load
from firmware.user import client, reception
from firmware.user.arguments import add_station, address
from firmware.user.listening import Listening, add_wish, wish_of
from firmware.user.mcap import Mcap
from firmware.user.received import Message

DESCRIPTION = """\
Records what a station's users receive, as messages of ROS 2 in one file of the
form MCAP, in its profile for ROS 2, which `ros2 bag`, Foxglove and PlotJuggler
read; it has been read back by mcap-ros2-support, and not tried with them. The
types are those of etsi_its_messages where it has the edition; their definitions
are in the file. For each type of message there are two topics:

  cam/received            the message, of the type etsi_its_cam_msgs/msg/CAM
  cam/received/metadata   time, signal strength, positions, edition, and the
                          octets of the PDU as they came

What no edition of the message library takes is on the second topic alone,
without an edition. Parts of a message that its ROS type has no field for are
in its octets there.

The file is not compressed. One that was not closed, because the power failed,
ends within its last two seconds; `mcap recover` mends it.
"""
EPILOG = """\
examples:
  captain record --mcap drive.mcap          everything, until Ctrl-C
  captain record --mcap minute.mcap --duration 60 --type cam --type denm
                                            a minute of two types
  captain record --mcap far.mcap --station 192.168.1.7
                                            of a station elsewhere

exit codes:
  0    the count or the duration is reached, or SIGTERM
  1    no station answers, there is no message library, or the file cannot be
       written
  2    wrong usage
  130  Ctrl-C; the file is whole
"""
FLUSH_S = 2.0
MOST_NAMES = 300  # more than there are messageIDs: a station that makes names up fills no recording with topics


# The profile "ros2" of MCAP asks for it. rosbag2 reads a text that is not empty as profiles with all nine keys,
# in words or numbers by the version of a record that it alone writes; for an empty one it takes its default, which is
# reliable and volatile, as the gateway publishes. Source: rosbag2_storage, qos.cpp: Rosbag2QoS::decode.
QOS = {"offered_qos_profiles": ""}


class Topic(NamedTuple):
    """Of an edition; `write` makes CDR of a decoded message."""

    name: str
    channel: int
    write: ros2.Cdr


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--mcap", metavar="FILE", type=Path, required=True, help="the recording, which must not exist")
    add_wish(parser)
    add_station(parser)


def main(arguments: argparse.Namespace) -> int:
    library = load()
    place = address(arguments)
    with (
        client.session() as context, _created(arguments.mcap) as stream, suppress(SystemExit), Ending() as ending,
    ):  # fmt: skip
        recording = Recording(stream, library)

        def idle() -> None:
            ending.check()
            recording.idle()

        try:
            listening = Listening(client.subscribe(context, place, place.to_users, ""), place, wish_of(arguments))
            for message in listening.messages(idle):
                recording.add(message)
                ending.check()
        finally:
            recording.close()
            print(f"captain: {arguments.mcap}: {recording.summary()}", file=sys.stderr)
    return 0


def _created(path: Path) -> BinaryIO:
    try:
        return path.open("xb")
    except FileExistsError:
        raise UsageError(f"--mcap: {path} is there already", "name another, or remove it") from None
    except OSError as error:
        raise RequestError(f"{path}: {error.strerror}", "does its folder exist, and may you write there?") from error


class Ending:
    """Ctrl-C and SIGTERM, which end a recording between two records: what is half written would not be read.

    check() raises what the signal stands for, KeyboardInterrupt or SystemExit; so does leaving it.
    """

    def __init__(self) -> None:
        self._number = 0
        self._before = {one: signal.signal(one, self._note) for one in (signal.SIGINT, signal.SIGTERM)}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if kind is None:
            self.check()

    def check(self) -> None:
        if self._number == signal.SIGINT:
            raise KeyboardInterrupt
        if self._number:
            raise SystemExit(0)

    def _note(self, number: int, _frame: FrameType | None) -> None:
        self._number = number


def topic_names(library: Library) -> dict[str, str]:
    """What stands before /received, for each edition: `cam` for the preferred one, `cam_2_1_1` for others."""
    preferred = {library.find(message.type).name for message in library.all()}
    names = [message.name for message in library.all()]
    return {name: name.partition("-")[0] if name in preferred else re.sub(r"\W", "_", name) for name in names}


class Recording:
    """Messages into MCAP; a topic begins with its first message."""

    def __init__(self, stream: BinaryIO, library: Library) -> None:
        self._mcap = Mcap(stream, "ros2", f"captain {VERSION}")
        self._decoder = Decoder(library)
        self._names = topic_names(library)
        self._types = ros2.Types(library.ros2_plan())
        self._topics: dict[str, Topic] = {}
        self._metadata: dict[str, int] = {}
        self._flushed = time.monotonic()
        self._unknown: Counter[str] = Counter()

    def add(self, message: Message) -> None:
        """A message, by the time of its reception."""
        received_ns = max(0, message.raw.received_ns) if message.raw is not None else time.time_ns()
        found = self._decoder.find(message.pdu, is_quick=True)
        if isinstance(found, Identity) and found.message.name in self._types:
            topic = self._topic(found.message)
            self._mcap.add(topic.channel, received_ns, topic.write(found.message.decode(message.pdu)))
            sequence, edition, name = self._mcap.counts[topic.channel], found.message.name, topic.name
        else:
            sequence, edition, name = 0, "", self._name_of(message)
            self._unknown[name] += 1
        if name not in self._metadata:
            self._metadata[name] = self._mcap.channel(
                f"{name}/received/metadata", reception.TYPE, reception.SCHEMA, QOS
            )
        self._mcap.add(self._metadata[name], received_ns, reception.cdr(message, received_ns, sequence, edition))

    def _name_of(self, message: Message) -> str:
        """That ROS takes in a topic, for what no edition takes: the type that the station gave it, or its messageID."""
        name = re.sub(r"\W", "_", message.type) or f"id_{message.message_id}"
        return name if name in self._metadata or len(self._metadata) < MOST_NAMES else "others"

    def _topic(self, message: library_.Message) -> Topic:
        edition = message.name
        if edition not in self._topics:
            name = self._names[edition]
            about = {**QOS, "topic_type_hash": self._types.hash(edition)}
            channel = self._mcap.channel(
                f"{name}/received", self._types.name(edition), self._types.definition(edition), about
            )
            self._topics[edition] = Topic(name, channel, self._types.writer(edition))
        return self._topics[edition]

    def idle(self) -> None:
        """Messages that are few get into the file as well."""
        if time.monotonic() - self._flushed >= FLUSH_S:
            self._flushed = time.monotonic()
            self._mcap.flush()

    def close(self) -> None:
        """The file is whole then."""
        self._mcap.close()

    def summary(self) -> str:
        """How many of which, in words."""
        words = [f"{self._mcap.counts[topic.channel]} {edition}" for edition, topic in sorted(self._topics.items())]
        words += [f"{count} {name} that no edition takes, as octets" for name, count in sorted(self._unknown.items())]
        return ", ".join(words) or "no message came"
