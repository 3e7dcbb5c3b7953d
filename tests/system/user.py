"""A user program as it exists: plain pyzmq sockets over TCP, nothing of the station's own code."""

import itertools
import json
import re
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import zmq

from tests.system.air import Air
from tests.system.rawrx import decode
from tests.system.station import PATIENCE, Station

HEARTBEAT = re.compile(rb'\{"heartbeat_counter": (0|[1-9][0-9]{0,4})\}')
JOIN_MS = 20
SUBSCRIBED = b"\1"  # to everything

# Station ids of marker messages; no test uses them otherwise.
_marks = itertools.count(0xF0000000)


def mark() -> bytes:
    """A CAM that no other is equal to: what arrives after it was sent after it."""
    return bytes((2, 2)) + next(_marks).to_bytes(4, "big") + b"mark"


class Received(NamedTuple):
    """The two messages of one PDU on 5556."""

    raw: bytes  # RawRxMessage
    envelope: bytes
    pdu: bytes

    @property
    def fields(self) -> dict[str, Any]:
        return decode(self.raw)


class Sender(Protocol):
    """A far end of some interface."""

    def send(self, pdu: bytes, /) -> object: ...


class User:
    """A PUB to 5555, a SUB to 5556 that takes everything, a PUSH to 5557.

    The PUB is an XPUB, which is the same on the wire, and can say when the station's subscription has come.
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
        """Until nothing that this user sends is lost, and what is on the air arrives here."""
        while self.pub.recv() != SUBSCRIBED:
            pass
        self.join_receiving(air)
        return self

    def join_receiving(self, air: Sender) -> None:
        """Until a probe arrives: what else does may lie here since an earlier subscription."""
        probes: set[bytes] = set()
        for probe in _probes():
            air.send(probe)
            probes.add(probe)
            if self._receives(probes):
                break
        air.send(last := mark())
        self.forget_until(last)

    def _receives(self, probes: set[bytes]) -> bool:
        """Whether one of them has come, or comes soon."""
        while self.sub.poll(JOIN_MS):
            if self.sub.recv_multipart()[-1] in probes:
                return True
        return False

    def forget_until(self, pdu: bytes, again: Callable[[], None] = lambda: None) -> None:
        """Read away all that was published up to a PDU; what makes it come is done again at each other message."""
        end = time.monotonic() + PATIENCE
        while self.sub.recv_multipart()[-1] != pdu:
            assert time.monotonic() < end, "nothing but heartbeats came"
            again()

    def send(self, *frames: bytes) -> None:
        """By 5555."""
        self.pub.send_multipart(frames)

    def push_pdu(self, envelope: bytes, pdu: bytes, **options: Any) -> None:
        """By 5557."""
        self.push.send_multipart([envelope, pdu] + ([json.dumps(options).encode()] if options else []))

    def next_frames(self) -> list[bytes]:
        """The next message on 5556 that is no heartbeat. Whatever the contract does not name fails here."""
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
        """The next PDU: its raw. message, then its v2x. message."""
        first, second = self.next_frames(), self.next_frames()
        assert first[0] == b"raw.", f"raw. comes first, not {first[0]!r}"
        assert second[0].startswith(b"v2x."), second
        received = Received(first[1], *second)
        assert received.fields["pdu"] == received.pdu
        return received

    def beat(self) -> int:
        """The next heartbeat's count."""
        while True:
            frames = self.sub.recv_multipart()
            if frames[0] == b"hb.counter":
                beat = HEARTBEAT.fullmatch(frames[1])
                assert beat is not None, frames[1]
                return int(beat[1])

    def hears_nothing_before_a_mark(self, air: Air) -> None:
        """What was thrown at the station before this moment was not passed on; good messages still are."""
        air.send(pdu := mark())
        assert self.receive().pdu == pdu

    def close(self) -> None:
        for each in (self.pub, self.sub, self.push):
            each.close()


def air_hears_nothing_before_a_mark(user: User, air: Air) -> None:
    """What the user sent before this moment did not leave; good messages still do."""
    user.send(b"v2x.cam.", pdu := mark())
    assert air.hear().pdu == pdu


class Reports:
    """A SUB to 5558."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], station: Station, topic: bytes = b"") -> None:
        self.sub = User._socket(context, zmq.SUB, station.address("report"))
        self.sub.subscribe(topic)

    def join(self, user: User) -> "Reports":
        """Until confirms of what the user pushes arrive here. What is refused goes on no air."""
        for number, _ in enumerate(_probes()):
            user.push_pdu(b"v2x.join", b"", label=f"join{number}")
            while self.sub.poll(JOIN_MS):
                topic, body = self.sub.recv_multipart()
                if topic.startswith(b"confirm.") and json.loads(body)["label"] == f"join{number}":
                    return self
        raise AssertionError("no confirm came")

    def next(self, topic: str = "confirm.") -> tuple[str, dict[str, Any]]:
        """The next message whose topic begins so."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            frames = self.sub.recv_multipart()
            assert len(frames) == 2, frames
            if frames[0].startswith(topic.encode()):
                return frames[0].decode(), json.loads(frames[1])
        raise AssertionError(f"no {topic} came")

    def confirms_of(self, label: str, count: int) -> list[dict[str, Any]]:
        """The next confirms that carry a label."""
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
