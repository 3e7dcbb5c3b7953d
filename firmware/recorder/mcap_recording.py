"""Recording of received messages in MCAP, as messages of ROS 2."""

import re
import time
from collections import Counter
from typing import BinaryIO, NamedTuple

from firmware import VERSION
from firmware.client.received import Message
from firmware.codec.decoding import Decoder
from firmware.codec.identify import Identity
from firmware.codec.library import Library
from firmware.recorder import ros2
from firmware.recordings import reception
from firmware.recordings.mcap import Mcap

FLUSH_S = 2.0
# Limit of topics for unknown types, above the number of messageIDs: a station with invented names cannot fill the file.
MOST_NAMES = 300


# The MCAP profile "ros2" requires this key. rosbag2 parses a nonempty text as a list of QoS profiles with all nine
# keys. Their format depends on a version that only rosbag2 itself writes. For an empty text it uses its default,
# reliable and volatile, which is also what the gateway publishes. Source: rosbag2_storage, qos.cpp: Rosbag2QoS::decode.
QOS = {"offered_qos_profiles": ""}


class Topic(NamedTuple):
    """MCAP topic of one message edition; `write` converts a decoded message to CDR."""

    name: str
    channel: int
    write: ros2.Cdr


def topic_names(library: Library) -> dict[str, str]:
    """Return the topic prefix of each edition: `cam` for the preferred one, `cam_2_1_1` for another.

    A topic's full name is the prefix and /received. Both forms of an edition share one topic.
    """
    preferred = {library.find(message.type).name for message in library.all()}
    names = {message.name: message.form_of or message.name for message in library.all()}
    return {
        edition: name.partition("-")[0] if name in preferred else re.sub(r"\W", "_", name)
        for edition, name in names.items()
    }


class Recording:
    """Recording of messages to MCAP. A topic is created at its first message."""

    def __init__(self, stream: BinaryIO, library: Library) -> None:
        self._mcap = Mcap(stream, "ros2", f"captain {VERSION}")
        self._decoder = Decoder(library)
        self._names = topic_names(library)
        self._types = ros2.Types(library.ros2_plan())
        self._topics: dict[str, Topic] = {}
        self._metadata: dict[str, int] = {}
        self._flushed = time.monotonic()
        self._unknown: Counter[str] = Counter()
        self._doubtful: Counter[str] = Counter()

    def add(self, message: Message) -> None:
        """Record a message: decoded if an edition matches, always with its metadata and octets.

        Its time is that of its reception.
        """
        received_ns = max(0, message.raw.received_ns) if message.raw is not None else time.time_ns()
        found = self._decoder.find(message.pdu)
        if isinstance(found, Identity) and found.message.name in self._types:
            if found.doubt:
                doubt = f"{found.message.name}: {found.doubt}"
                is_known = doubt in self._doubtful or len(self._doubtful) < MOST_NAMES
                self._doubtful[doubt if is_known else "others"] += 1
            topic = self._topic(found.message.form_of or found.message.name)
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
        """Return a topic prefix for an undecodable message: the type given by the station, or its messageID."""
        name = re.sub(r"\W", "_", message.type) or f"id_{message.message_id}"
        return name if name in self._metadata or len(self._metadata) < MOST_NAMES else "others"

    def _topic(self, edition: str) -> Topic:
        if edition not in self._topics:
            name = self._names[edition]
            about = {**QOS, "topic_type_hash": self._types.hash(edition)}
            channel = self._mcap.channel(
                f"{name}/received", self._types.name(edition), self._types.definition(edition), about
            )
            self._topics[edition] = Topic(name, channel, self._types.writer(edition))
        return self._topics[edition]

    def idle(self) -> None:
        """Write buffered messages to the file every FLUSH_S, so that rare messages do not wait for a full chunk."""
        if time.monotonic() - self._flushed >= FLUSH_S:
            self._flushed = time.monotonic()
            self._mcap.flush()

    def close(self) -> None:
        """Complete the file."""
        self._mcap.close()

    def summary(self) -> str:
        """Return the number of messages per edition as text."""
        words = [f"{self._mcap.counts[topic.channel]} {edition}" for edition, topic in sorted(self._topics.items())]
        words += [f"{count} {name} that no edition takes, as octets" for name, count in sorted(self._unknown.items())]
        words += [f"{count} doubtful {doubt}" for doubt, count in sorted(self._doubtful.items())]
        return ", ".join(words) or "no message came"
