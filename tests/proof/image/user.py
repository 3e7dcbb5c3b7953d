"""A user's program of another machine: plain pyzmq, nothing of this project."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import zmq

from tests.proof.image.machine import NotSeenError, Ports

FIRST_S = 600.0  # the station has to start: emulated, on a busy machine
CAM = bytes.fromhex("020200000539") + bytes(35)


class User:
    """received: from the station's port 5556; sent: to its 5555; reported: from its 5558."""

    def __init__(self, context: "zmq.Context[zmq.Socket[bytes]]", ports: Ports) -> None:
        self.sent = context.socket(zmq.PUB)
        self.received = context.socket(zmq.SUB)
        self.reported = context.socket(zmq.SUB)
        self.received.setsockopt(zmq.SUBSCRIBE, b"")
        self.reported.setsockopt(zmq.SUBSCRIBE, b"status.")
        sockets = ((self.sent, ports.from_users), (self.received, ports.to_users), (self.reported, ports.report))
        for one, port in sockets:
            one.setsockopt(zmq.RECONNECT_IVL, 500)
            # QEMU takes the connection before the guest's station does: one that never speaks is tried again.
            one.setsockopt(zmq.HANDSHAKE_IVL, 5000)
            one.setsockopt(zmq.LINGER, 0)
            one.connect(f"tcp://127.0.0.1:{port}")

    def hear(self, topic: bytes, limit_s: float = FIRST_S) -> bytes:
        """The body of the next message whose envelope begins so. Raises NotSeenError."""
        ends = time.monotonic() + limit_s
        while self.received.poll(max(0, round(1000 * (ends - time.monotonic())))):
            envelope, body = self.received.recv_multipart()[:2]
            if envelope.startswith(topic):
                return body
        raise NotSeenError(f"no {topic.decode()} came from port 5556 within {limit_s:.0f} s")

    def heartbeat(self) -> int:
        """The next one's number."""
        return int(json.loads(self.hear(b"hb."))["heartbeat_counter"])

    def status(self) -> dict[str, Any]:
        """The next one that the station reports. Raises NotSeenError."""
        if not self.reported.poll(round(1000 * FIRST_S)):
            raise NotSeenError("no status came from port 5558")
        return dict(json.loads(self.reported.recv_multipart()[-1]))

    def wait_up(self, interface: str) -> None:
        """Until the station has it. Raises NotSeenError."""
        ends = time.monotonic() + FIRST_S
        while (told := self.status()["interfaces"][interface])["state"] != "up":
            if time.monotonic() > ends:
                raise NotSeenError(f"{interface} is not up within {FIRST_S:.0f} s: {told}")


@contextmanager
def user(ports: Ports) -> Iterator[User]:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    try:
        yield User(context, ports)
    finally:
        context.destroy(linger=0)
