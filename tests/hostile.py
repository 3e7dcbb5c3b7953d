"""A peer that speaks ZMTP 3.0 (23/ZMTP) by hand, and so may say what libzmq's own sockets never say."""

import socket
from collections.abc import Callable

GREETING = b"\xff" + bytes(8) + b"\x7f" + b"\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
PATIENCE_S = 2.0
ESTABLISHED = 1  # tcpi_state: TCP_ESTABLISHED


class Peer:
    """One TCP connection; the handshake is done when this returns.

    turn  lets the station go on, where it is in this process.
    """

    def __init__(self, port: int, kind: bytes = b"SUB", turn: Callable[[], object] = lambda: None) -> None:
        ready = b"\x05READY\x0bSocket-Type" + len(kind).to_bytes(4, "big") + kind
        self.socket = socket.create_connection(("127.0.0.1", port), PATIENCE_S)
        self.socket.sendall(GREETING + b"\x04" + bytes((len(ready),)) + ready)
        answer = b""
        while b"Socket-Type" not in answer:
            turn()
            answer += self.socket.recv(200)

    def send(self, body: bytes, more: bool = False) -> None:
        self.socket.sendall(frame(body, more))

    def subscribe(self, topic: bytes) -> None:
        self.send(b"\1" + topic)

    def unsubscribe(self, topic: bytes) -> None:
        self.send(b"\0" + topic)

    def is_cut(self) -> bool:
        """Whether the station has ended the connection; what it sent before that is read away."""
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
        """What has come until now."""
        self.socket.settimeout(0.001)
        octets = b""
        try:
            while part := self.socket.recv(1 << 20):
                octets += part
        except TimeoutError:
            pass
        return octets

    def is_ended(self) -> bool:
        """As is_cut(), of a peer that does not read."""
        state = self.socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0]
        return state != ESTABLISHED

    def close(self) -> None:
        self.socket.close()


def frame(body: bytes, more: bool = False) -> bytes:
    """A frame of a message; more: another one follows."""
    if len(body) < 256:
        return bytes((more, len(body))) + body
    return bytes((2 | more,)) + len(body).to_bytes(8, "big") + body
