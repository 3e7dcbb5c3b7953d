"""User program for tests: pyzmq sockets over TCP, without the station's code."""

import itertools
import json
import re
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import zmq

from tests.reference.topics import undocumented
from tests.system.air import Air
from tests.system.rawrx import decode
from tests.system.station import PATIENCE, Station

HEARTBEAT = re.compile(rb'\{"heartbeat_counter": (0|[1-9][0-9]{0,4})\}')
JOIN_MS = 20
SUBSCRIBED = b"\1"  # subscription to everything

# StationIDs of marker messages. Tests do not use them for other messages.
_marks = itertools.count(0xF0000000)


def mark() -> bytes:
    """Return a unique CAM. When it arrives, all earlier messages have arrived."""
    return bytes((2, 2)) + next(_marks).to_bytes(4, "big") + b"mark"


class Received(NamedTuple):
    """Both messages of a PDU on port 5556."""

    raw: bytes  # RawRxMessage
    envelope: bytes
    pdu: bytes

    @property
    def fields(self) -> dict[str, Any]:
        return decode(self.raw)


class Sender(Protocol):
    """Far end of an interface, which sends PDUs to the station."""

    def send(self, pdu: bytes, /) -> object: ...


class User:
    """User with a PUB to 5555, a SUB to 5556 that is subscribed to everything, and a PUSH to 5557.

    The PUB is an XPUB, which is the same on the wire and shows when the station's subscription has arrived.
    """

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], station: Station) -> None:
        self.pub = self._socket(context, zmq.XPUB, station.address("from_users"))
        self.pub.setsockopt(zmq.XPUB_VERBOSE, 1)  # a restarted station subscribes again
        self.sub = self._socket(context, zmq.SUB, station.address("to_users"))
        self.sub.subscribe(b"")
        self.push = self._socket(context, zmq.PUSH, station.address("pull"))

    @staticmethod
    def _socket(context: zmq.Context[zmq.Socket[bytes]], kind: int, address: str) -> "zmq.Socket[bytes]":
        made = context.socket(kind)
        made.linger = 0
        made.rcvhwm = made.sndhwm = 0
        made.rcvtimeo = made.sndtimeo = int(PATIENCE * 1000)
        made.connect(address)
        return made

    def join(self, air: Air) -> "User":
        """Wait until messages of this user reach the station, and messages on the air reach this user."""
        while self.pub.recv() != SUBSCRIBED:
            pass
        self.join_receiving(air)
        return self

    def join_receiving(self, air: Sender) -> None:
        """Wait until a probe arrives. Other messages may be left from an earlier subscription and are discarded."""
        probes: set[bytes] = set()
        for probe in _probes():
            air.send(probe)
            probes.add(probe)
            if self._receives(probes):
                break
        air.send(last := mark())
        self.forget_until(last)

    def _receives(self, probes: set[bytes]) -> bool:
        """Return True if one of the probes has arrived or arrives soon."""
        while self.sub.poll(JOIN_MS):
            if self.sub.recv_multipart()[-1] in probes:
                return True
        return False

    def forget_until(self, pdu: bytes, again: Callable[[], None] = lambda: None) -> None:
        """Discard messages until a PDU arrives. again() is called after each other message, to cause it once more."""
        end = time.monotonic() + PATIENCE
        while self.sub.recv_multipart()[-1] != pdu:
            assert time.monotonic() < end, "nothing but heartbeats came"
            again()

    def send(self, *frames: bytes) -> None:
        """Send a message by port 5555."""
        self.pub.send_multipart(frames)

    def push_pdu(self, envelope: bytes, pdu: bytes, **options: Any) -> None:
        """Send a message with options by port 5557."""
        self.push.send_multipart([envelope, pdu] + ([json.dumps(options).encode()] if options else []))

    def next_frames(self) -> list[bytes]:
        """Return the next message on 5556 except heartbeats. Fail for a message that the contract does not define."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            frames = self.sub.recv_multipart()
            assert len(frames) == 2, f"{len(frames)} frames: {frames}"
            if frames[0] != b"hb.counter":
                assert frames[0] == b"raw." or re.fullmatch(rb"v2x\.[a-z0-9_]*\.", frames[0]), frames
                return frames
            beat = HEARTBEAT.fullmatch(frames[1])
            assert beat is not None, frames[1]
        raise AssertionError("nothing but heartbeats came")

    def receive(self) -> Received:
        """Return the next PDU: its `raw.` message, then its `v2x.` message."""
        first, second = self.next_frames(), self.next_frames()
        assert first[0] == b"raw.", f"raw. comes first, not {first[0]!r}"
        assert second[0].startswith(b"v2x."), second
        received = Received(first[1], *second)
        assert received.fields["pdu"] == received.pdu
        return received

    def beat(self) -> int:
        """Return the count of the next heartbeat."""
        while True:
            frames = self.sub.recv_multipart()
            if frames[0] == b"hb.counter":
                beat = HEARTBEAT.fullmatch(frames[1])
                assert beat is not None, frames[1]
                return int(beat[1])

    def hears_nothing_before_a_mark(self, air: Air) -> None:
        """Check that all frames sent before this call were dropped: the next message to this user is a new mark."""
        air.send(pdu := mark())
        assert self.receive().pdu == pdu

    def close(self) -> None:
        for each in (self.pub, self.sub, self.push):
            each.close()


def air_hears_nothing_before_a_mark(user: User, air: Air) -> None:
    """Check that all messages of the user before this call were dropped: the next one on the air is a new mark."""
    user.send(b"v2x.cam.", pdu := mark())
    assert air.hear().pdu == pdu


class Reports:
    """Subscriber of the reports on port 5558."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], station: Station, topic: bytes = b"") -> None:
        self.sub = User._socket(context, zmq.SUB, station.address("report"))
        self.sub.subscribe(topic)

    def join(self, user: User) -> "Reports":
        """Wait until confirms of the user's requests arrive. The requests are refused, so that none is sent."""
        for number, _ in enumerate(_probes()):
            user.push_pdu(b"v2x.join", b"", label=f"join{number}")
            while self.sub.poll(JOIN_MS):
                topic, body = self.sub.recv_multipart()
                if topic.startswith(b"confirm.") and json.loads(body)["label"] == f"join{number}":
                    return self
        raise AssertionError("no confirm came")

    def next(self, topic: str = "confirm.") -> tuple[str, dict[str, Any]]:
        """Return the next message whose topic begins with `topic`."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            frames = self.sub.recv_multipart()
            assert len(frames) == 2, frames
            if frames[0].startswith(topic.encode()):
                found, said = frames[0].decode(), json.loads(frames[1])
                assert undocumented(found.split(".")[0], said) == []
                return found, said
        raise AssertionError(f"no {topic} came")

    def confirms_of(self, label: str, count: int) -> list[dict[str, Any]]:
        """Return the next `count` confirms with a label."""
        found: list[dict[str, Any]] = []
        while len(found) < count:
            message = self.next("confirm.")[1]
            if message["label"] == label:
                found.append(message)
        return found

    def close(self) -> None:
        self.sub.close()


def _probes() -> Iterator[bytes]:
    for _ in range(int(1000 * PATIENCE / JOIN_MS)):
        yield mark()
    raise AssertionError("the station does not answer")
