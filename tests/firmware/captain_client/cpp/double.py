"""Double of a station for clients: it publishes and confirms what a test tells it to."""

import json
import time
from typing import Any

import zmq

from tests.system.ports import Ports
from tests.system.station import PATIENCE

SUBSCRIBED = b"\1"


class Double:
    """Ports 5557 and 5558 of a station, at ports of its own.

    run  text that each start of a station makes up.
    """

    def __init__(self, ports: Ports) -> None:
        self.first = ports.take_row(4)[0]
        self.run = "run-1"
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._pull, self._report = self._bound(zmq.PULL, 2), self._bound(zmq.XPUB, 3)

    @property
    def address(self) -> str:
        return f":{self.first}"

    def start_again(self, run: str) -> None:
        self.run = run
        self._context = zmq.Context()
        self._pull, self._report = self._bound(zmq.PULL, 2), self._bound(zmq.XPUB, 3)

    def _bound(self, kind: int, offset: int) -> "zmq.Socket[bytes]":
        socket = self._context.socket(kind)
        if kind == zmq.XPUB:
            socket.setsockopt(zmq.XPUB_VERBOSE, 1)
        socket.linger, socket.rcvtimeo = 0, int(PATIENCE * 1000)
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                socket.bind(f"tcp://127.0.0.1:{self.first + offset}")
            except zmq.ZMQError:  # libzmq closes the port of an earlier socket in the background
                assert time.monotonic() < deadline
            else:
                return socket

    def stop(self) -> None:
        self._context.destroy(linger=0)

    def stop_taking(self) -> None:
        """End the connection for messages only, as a proxy does at its own time."""
        self._pull.close()

    def take_again(self) -> None:
        self._pull = self._bound(zmq.PULL, 2)

    def publish(self, topic: str, said: object, *frames: bytes) -> None:
        self._report.send_multipart([topic.encode(), json.dumps(said).encode(), *frames])

    def publish_octets(self, topic: bytes, *frames: bytes) -> None:
        self._report.send_multipart([topic, *frames])

    def publish_status(self, uptime_s: float = 0.0) -> None:
        self.publish("status.", {"run": self.run, "station": "double", "uptime_s": uptime_s})

    def wait_for_subscription(self, topic: str) -> None:
        while self._report.recv() != SUBSCRIBED + topic.encode():
            pass

    def welcome(self) -> None:
        """Answer the connection of a client: a status proves its subscriptions."""
        self.wait_for_subscription("status.")
        self.publish_status()

    def take(self) -> tuple[bytes, bytes, dict[str, Any]]:
        """Return the next message of the client: envelope, body and options."""
        envelope, body, options = self._pull.recv_multipart()
        return envelope, body, json.loads(options)

    def takes_nothing(self, wait_ms: int) -> bool:
        return not self._pull.poll(wait_ms)

    def confirm(self, label: str, outcome: str, **more: object) -> None:
        usual: dict[str, object] = {"interfaces": [], "interface": "", "reason": None, "meaning": None, "detail": ""}
        self.publish("confirm.cam.", {**usual, "label": label, "outcome": outcome, **more})

    def publish_plain(self, sequence: int, kind: str = "cam", **message: object) -> None:
        reception = {"run": self.run, "sequence": sequence, "interface": "g5", "received_ns": 1_795_182_426_461_613_000,
                     "rssi_dbm": -71, "source": "02:00:00:00:00:0b"}  # fmt: skip
        self.publish(f"plain.{kind}.", {"edition": "cam-1.4.1", "type": kind, "reception": reception, **message})
