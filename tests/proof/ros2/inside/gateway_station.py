"""A station that a test plays, as a gateway meets it: what it publishes, and what it takes."""

import hashlib
import json
import time
from typing import Any

import zmq

from drivers.message import Position, RxInfo
from drivers.wire import raw

HEARTBEAT_S = 0.5


class Played:
    """Its sockets. ports: of the endpoint by name."""

    def __init__(self, ports: dict[str, int]) -> None:
        self._ports = ports
        self._context: zmq.Context[Any] = zmq.Context()
        self._next = 0.0
        self.taken: list[list[bytes]] = []
        self.open()

    def open(self) -> None:
        self._users = self._bound(zmq.PUB, "to_users")
        self._report = self._bound(zmq.PUB, "report")
        self._pull = self._bound(zmq.PULL, "pull")

    def close(self) -> None:
        for socket in (self._users, self._report, self._pull):
            socket.close(0)

    def turn(self) -> None:
        """Its heartbeat, and what users have sent."""
        if self._users.closed:
            return
        if time.monotonic() > self._next:
            self._next = time.monotonic() + HEARTBEAT_S
            self._users.send_multipart([b"hb.counter", b'{"heartbeat_counter": 7}'])
        while True:
            try:
                self.taken.append(self._pull.recv_multipart(zmq.NOBLOCK))
            except zmq.Again:
                return

    def indicate(self, kind: str, pdu: bytes, rx: RxInfo, own: Position, interface: str | None) -> int:
        """As a station does with a received message; without an interface it tells nothing of it. Its time in ns."""
        received_ns = time.time_ns() // 1000 * 1000
        self._users.send_multipart([b"raw.", raw.build(pdu, received_ns, rx, (received_ns + 1_000_000, own))])
        self._users.send_multipart([f"v2x.{kind}.".encode(), pdu])
        if interface is not None:
            told = {
                "digest": hashlib.sha256(pdu).hexdigest()[:16], "interface": interface, "received_ns": received_ns + 789,
                "btp_port": rx.btp_port, "source": rx.source_mac.hex(":"),
            }  # fmt: skip
            self._report.send_multipart([f"indication.{kind}.".encode(), json.dumps(told).encode()])
        return received_ns

    def users(self, *frames: bytes) -> None:
        self._users.send_multipart(list(frames))

    def report(self, topic: str, told: dict[str, object]) -> None:
        self._report.send_multipart([topic.encode(), json.dumps(told).encode()])

    def _bound(self, kind: int, name: str) -> Any:
        socket = self._context.socket(kind)
        socket.bind(f"tcp://127.0.0.1:{self._ports[name]}")
        return socket
