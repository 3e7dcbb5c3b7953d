"""A user program as it exists: plain pyzmq sockets over TCP, nothing of the station's own code."""

import itertools
import json
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import zmq

from tests.system.air import Air
from tests.system.rawrx import decode
from tests.system.station import PATIENCE, Station

HEARTBEAT = re.compile(rb'\{"heartbeat_counter": (0|[1-9][0-9]{0,4})\}')
JOIN_MS = 20

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


class User:
    """A PUB to 5555, a SUB to 5556 that takes everything, a PUSH to 5557."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], station: Station) -> None:
        self.pub = self._socket(context, zmq.PUB, station.address("from_users"))
        self.sub = self._socket(context, zmq.SUB, station.address("to_users"))
        self.sub.subscribe(b"")
        self.push = self._socket(context, zmq.PUSH, station.address("pull"))
        self.heartbeats: list[int] = []

    @staticmethod
    def _socket(context: zmq.Context[zmq.Socket[bytes]], kind: int, address: str) -> "zmq.Socket[bytes]":
        made = context.socket(kind)
        made.linger = 0
        made.rcvhwm = made.sndhwm = 0
        made.rcvtimeo = made.sndtimeo = int(PATIENCE * 1000)
        made.connect(address)
        return made

    def join(self, air: Air) -> "User":
        """Until what this user sends arrives on the air, and what is on the air arrives here."""
        self._join_sending(air)
        self._join_receiving(air)
        return self

    def _join_sending(self, air: Air) -> None:
        air.socket.settimeout(JOIN_MS / 1000)
        for probe in _probes():
            self.send(b"v2x.", probe)
            try:
                heard = air.hear()
                break
            except TimeoutError:
                continue
        air.socket.settimeout(PATIENCE)
        while heard.pdu != probe:
            heard = air.hear()

    def _join_receiving(self, air: Air) -> None:
        for probe in _probes():
            air.send(probe)
            if self.sub.poll(JOIN_MS) and self.sub.recv_multipart()[0] != b"hb.counter":
                break
        air.send(last := mark())
        while self.sub.recv_multipart()[-1] != last:
            pass

    def send(self, *frames: bytes) -> None:
        """By 5555."""
        self.pub.send_multipart(frames)

    def push_pdu(self, envelope: bytes, pdu: bytes, **options: Any) -> None:
        """By 5557."""
        self.push.send_multipart([envelope, pdu] + ([json.dumps(options).encode()] if options else []))

    def next_frames(self) -> list[bytes]:
        """The next message on 5556 that is no heartbeat. Whatever the contract does not name fails here."""
        while True:
            frames = self.sub.recv_multipart()
            assert len(frames) == 2, f"{len(frames)} frames: {frames}"
            if frames[0] != b"hb.counter":
                assert frames[0] == b"raw." or re.fullmatch(rb"v2x\.[a-z0-9_]*\.", frames[0]), frames
                return frames
            beat = HEARTBEAT.fullmatch(frames[1])
            assert beat is not None, frames[1]
            self.heartbeats.append(int(beat[1]))

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

    def join(self, user: User, air: Air) -> "Reports":
        """Until confirms of what the user pushes arrive here; what they sent is heard and forgotten."""
        for probe in _probes():
            user.push_pdu(b"v2x.", probe)
            if self.sub.poll(JOIN_MS):
                break
        user.push_pdu(b"v2x.", last := mark(), label="joined")
        while self.next("confirm.")[1]["outcome"] != "sent" or self.message["label"] != "joined":
            pass
        while air.hear().pdu != last:
            pass
        return self

    def next(self, topic: str = "confirm.") -> tuple[str, dict[str, Any]]:
        """The next message whose topic begins so."""
        while True:
            frames = self.sub.recv_multipart()
            assert len(frames) == 2, frames
            self.message: dict[str, Any] = json.loads(frames[1])
            if frames[0].startswith(topic.encode()):
                return frames[0].decode(), self.message

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
