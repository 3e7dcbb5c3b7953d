"""MQTT broker that omits acknowledgements, or does not read."""

import contextlib
import queue
import socket
import ssl
import threading
from collections.abc import Iterator
from typing import NamedTuple

from tests.broker.bad import Listener

# Types of control packets: MQTT 5.0, table 2-1.
CONNECT, CONNACK, PUBLISH, PUBACK, SUBSCRIBE, SUBACK = 1, 2, 3, 4, 8, 9
UNSUBSCRIBE, UNSUBACK, PINGREQ, PINGRESP = 10, 11, 12, 13
VERSION_5 = 5


class Packet(NamedTuple):
    """A control packet as it came: type, flags, all behind the fixed header."""

    kind: int
    flags: int
    body: bytes


class Mute(Listener):
    """Every packet that it reads is in `packets`.

    never      types that it does not send: CONNACK, SUBACK, PUBACK, PINGRESP.
    connack, suback, puback  reason codes; suback None: what was asked for.
    reads      so many PUBLISH of a connection; then it reads nothing more. None: all.
    """

    def __init__(
        self,
        never: frozenset[int] = frozenset(),
        *,
        connack: int = 0,
        suback: int | None = None,
        puback: int = 0,
        reads: int | None = None,
        context: ssl.SSLContext | None = None,
    ) -> None:
        self.packets: queue.SimpleQueue[Packet] = queue.SimpleQueue()
        self._never = never
        self._connack, self._suback, self._puback = connack, suback, puback
        self._reads = reads
        self._spoken_to: set[socket.socket] = set()
        super().__init__(self._talk, context)

    def next(self, kind: int, patience: float = 5.0) -> Packet:
        """The next packet of a type; others before it are thrown away."""
        while (packet := self.packets.get(timeout=patience)).kind != kind:
            pass
        return packet

    def throw(self, octets: bytes) -> None:
        """To every connected client, as it is."""
        for line in list(self._spoken_to):
            with contextlib.suppress(OSError):
                line.sendall(octets)

    def _talk(self, line: socket.socket, over: threading.Event) -> None:
        self._spoken_to.add(line)
        version, published = VERSION_5, 0
        try:
            for packet in packets(line):
                self.packets.put(packet)
                if packet.kind == CONNECT:
                    version = packet.body[6]
                published += packet.kind == PUBLISH
                if self._reads is not None and published > self._reads:
                    over.wait()
                    return
                if answer := self._answer(packet, version):
                    line.sendall(answer)
        finally:
            self._spoken_to.discard(line)

    def _answer(self, packet: Packet, version: int) -> bytes:
        none = b"\0" if version == VERSION_5 else b""  # no properties
        number = packet.body[:2]
        match packet.kind:
            case 1:
                return self._packet(CONNACK, bytes((0, self._connack)) + none)
            case 3 if packet.flags >> 1 & 3:
                start = 2 + int.from_bytes(packet.body[:2], "big")
                reason = bytes((self._puback,)) if self._puback and version == VERSION_5 else b""
                return self._packet(PUBACK, packet.body[start : start + 2] + reason)
            case 8:
                asked = _asked(packet.body, version)
                return self._packet(SUBACK, number + none + (asked if self._suback is None else self._granted(asked)))
            case 10:
                return self._packet(UNSUBACK, number + none + (b"\0" if version == VERSION_5 else b""))
            case 12:
                return self._packet(PINGRESP, b"")
        return b""

    def _granted(self, asked: bytes) -> bytes:
        return bytes((self._suback or 0,)) * len(asked)

    def _packet(self, kind: int, body: bytes) -> bytes:
        return b"" if kind in self._never else bytes((kind << 4, len(body))) + body


def publication(topic: str, payload: bytes, version: int = VERSION_5, number: int = 0) -> bytes:
    """A PUBLISH, for throw(). number: of the packet, at QoS 1; 0: at QoS 0."""
    name = topic.encode()
    body = len(name).to_bytes(2, "big") + name
    body += (number.to_bytes(2, "big") if number else b"") + (b"\0" if version == VERSION_5 else b"") + payload
    return bytes((PUBLISH << 4 | 2 * (number > 0),)) + _length(len(body)) + body


def packets(line: socket.socket) -> Iterator[Packet]:
    """Those of a client, until it has gone."""
    with line.makefile("rb") as stream:
        while first := stream.read(1):
            size, shift, more = 0, 0, 0x80
            while more:
                if not (octet := stream.read(1)):
                    return  # the client has gone in the middle of it
                size |= (octet[0] & 0x7F) << shift
                shift += 7
                more = octet[0] & 0x80
            if len(body := stream.read(size)) < size:
                return
            yield Packet(first[0] >> 4, first[0] & 15, body)


def _asked(body: bytes, version: int) -> bytes:
    """The quality of service that each filter of a SUBSCRIBE asks for."""
    at = 2
    if version == VERSION_5:
        at += 1 + body[2]  # less than 128 octets of properties
    asked = bytearray()
    while at < len(body):
        at += 2 + int.from_bytes(body[at : at + 2], "big")
        asked.append(body[at] & 3)
        at += 1
    return bytes(asked)


def _length(octets: int) -> bytes:
    """Variable byte integer: MQTT 5.0, 1.5.5."""
    made = bytearray()
    while True:
        octets, part = octets >> 7, octets & 0x7F
        made.append(part | (0x80 if octets else 0))
        if not octets:
            return bytes(made)
