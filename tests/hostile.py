"""Hostile peers: ZMTP 3.0 and 2.0 by hand (23/ZMTP, 15/ZMTP), to send what libzmq never sends."""

import socket
from collections.abc import Callable

from tests.system.station import PATIENCE

GREETING = b"\xff" + bytes(8) + b"\x7f" + b"\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
PATIENCE_S = PATIENCE  # timeout in seconds, which only a failing test reaches
GREETING_2_0 = 12  # octets: signature, revision, type of the socket
KINDS_2_0 = {b"PUB": b"\1", b"SUB": b"\2", b"PUSH": b"\x08"}
ESTABLISHED = 1  # tcpi_state: TCP_ESTABLISHED


class Peer:
    """Peer on one TCP connection. The constructor returns after the handshake.

    turn  runs the station's loop once, if the station is in this process.
    """

    def __init__(self, port: int, kind: bytes = b"SUB", turn: Callable[[], object] = lambda: None) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        self.socket.sendall(self.greeting(kind))
        answer = b""
        while not self.is_answered(answer):
            turn()
            part = self.socket.recv(200)
            if not part:
                raise ConnectionResetError("ended in the handshake")
            answer += part

    def greeting(self, kind: bytes) -> bytes:
        """Return the octets of the handshake up to the first message."""
        ready = b"\x05READY\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind
        return GREETING + b"\x04" + bytes((len(ready),)) + ready

    def is_answered(self, octets: bytes) -> bool:
        """Return True if the handshake is complete."""
        return b"Socket-Type" in octets

    def send(self, body: bytes, more: bool = False) -> None:
        self.socket.sendall(frame(body, more))

    def subscribe(self, topic: bytes) -> None:
        self.send(b"\1" + topic)

    def unsubscribe(self, topic: bytes) -> None:
        self.send(b"\0" + topic)

    def is_cut(self) -> bool:
        """Return True if the station has ended the connection. Octets that it sent before are read and discarded."""
        self.socket.settimeout(0.001)
        try:
            while self.socket.recv(65536):
                pass
        except TimeoutError:
            return False
        except OSError:
            return True
        return True

    def read(self) -> bytes:
        """Return the octets that have arrived so far."""
        self.socket.settimeout(0.001)
        octets = b""
        try:
            while part := self.socket.recv(1 << 20):
                octets += part
        except TimeoutError:
            pass
        return octets

    def is_ended(self) -> bool:
        """Return True if the station has ended the connection, without reading from it."""
        state = self.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0]
        return state != ESTABLISHED

    def close(self) -> None:
        self.socket.close()


class OldPeer(Peer):
    """As Peer, of ZMTP 2.0: it has no metadata, and so libzmq tells no descriptor with its messages."""

    def greeting(self, kind: bytes) -> bytes:
        return b"\xff" + bytes(8) + b"\x7f\x01" + KINDS_2_0[kind] + frame(b"")

    def is_answered(self, octets: bytes) -> bool:
        return len(octets) >= GREETING_2_0


def frame(body: bytes, more: bool = False) -> bytes:
    """A frame of a message; more: another one follows."""
    if len(body) < 256:
        return bytes((more, len(body))) + body
    return bytes((2 | more,)) + len(body).to_bytes(8, "big") + body
