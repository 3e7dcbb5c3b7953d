"""A station as its users see it, and nothing behind: sockets that say what a test wants them to say."""

import contextlib
import json
import socket
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import zmq

from drivers.message import Indication, RxInfo
from firmware.endpoint.deliveries import delivery_of
from firmware.endpoint.report import run_id
from firmware.topics import Topics, TypeRow

Frames = Sequence[bytes]
# The third frame's object and the number of the request -> confirms to publish.
Answer = Callable[[dict[str, object], int], list[dict[str, object]]]

RECEIVED_NS = 1795182426_461613000
STATUS: dict[str, object] = {
    "run": run_id(),
    "station": "fake",
    "version": "0.1.0",
    "profile": "standard",
    "pid": 4711,
    "time": 1795182426.4,
    "uptime_s": 192.0,
    "interfaces": {
        "g5": {
            "driver": "udp",
            "technology": "its-g5",
            "state": "up",
            "why": "bound to 127.0.0.1:8947",
            "since_s": 190.1,
            "restarts": 2,
            "neighbours": 3,
            "received": {"cam": 1204, "denm": 4},
            "sent": {"denm": 1},
            "queue": {"length": 1, "capacity": 256, "longest": 17},
        }
    },
    "endpoint": {"requests": 5, "accepted": 4, "published": 1208, "raw": 10, "slow_since": None},
    "drops": [
        {
            "where": "g5",
            "reason": "short-pdu",
            "meaning": "the PDU is shorter than the 6 octets of an ITS PDU header",
            "count": 3,
            "time": 1795182420.0,
            "octets": 5,
            "sample": "0202000005",
        }
    ],
    "duplicates": {"window_s": 2.0, "suppressed": 7, "first": {"g5": 3, "5g": 4}, "lead_ms": {"g5": 1.5, "5g": 0.5}},
    "policy": [{"name": "default", "matched": 5}],
    "cpu_s": 0.1,
    "memory_kb": 17000,
}


def delivered(kind: str, pdu: bytes, sequence: int = 1, rx: RxInfo | None = None) -> Frames:
    """Return the report of a delivered message, as a station sends it. kind: any name; empty for none."""
    row = Topics(extra=[TypeRow(200, kind, None, None)]).by_number[200]
    one = Indication(row, pdu, "g5", RECEIVED_NS, 0.0, rx or RxInfo())
    return f"message.{kind}.".encode(), json.dumps(delivery_of(one, sequence)).encode(), pdu


class FakeStation:
    """Four sockets on free ports, served by a thread.

    received  what it publishes to users as soon as one has subscribed to `v2x.` or to everything.
    reports   what it publishes on its report port when one has subscribed to `status.`, after a status.
    status    this status.
    answer    the confirms about a request.
    requests  what came to PULL.
    """

    def __init__(self, received: Sequence[Frames] = (), reports: Sequence[Frames] = (), answer: Answer | None = None):
        self.requests: list[list[bytes]] = []
        self.is_silent = False
        self.status = STATUS
        self._received = received
        self._reports = reports
        self._answer = answer
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._sockets = [self._context.socket(kind) for kind in (zmq.SUB, zmq.XPUB, zmq.PULL, zmq.XPUB)]
        self._from_users, self._to_users, self._pull, self._report = self._sockets
        self.ports = [one.bind_to_random_port("tcp://127.0.0.1", max_port=60000) for one in self._sockets]
        self._end, self._ended = socket.socketpair()
        self._thread = threading.Thread(target=self._serve)

    @property
    def options(self) -> list[str]:
        """The command line's options that name it."""
        first, to_users, pull, report = map(str, self.ports)
        return ["--station", f"127.0.0.1:{first}", "--to-users", to_users, "--pull", pull, "--report", report]

    def __enter__(self) -> "FakeStation":
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._end.close()
        self._thread.join()
        self._ended.close()
        self._context.destroy(linger=0)

    def _serve(self) -> None:
        poller = zmq.Poller()
        for one in (self._to_users, self._pull, self._report, self._ended):
            poller.register(one, zmq.POLLIN)
        while True:
            ready = dict(poller.poll())
            if self._ended.fileno() in ready:
                return
            if self._to_users in ready and self._to_users.recv()[:5] in (b"\1", b"\1v2x."):
                self._say()
            if self._report in ready and self._report.recv() == b"\1status.":
                self._tell()
            if self._pull in ready:
                self._request(self._pull.recv_multipart())

    def _tell(self) -> None:
        if not self.is_silent:
            self._publish(self._report, [(b"status.", json.dumps(self.status).encode()), *self._reports])

    def _say(self) -> None:
        if not self.is_silent:
            self._publish(self._to_users, [(b"hb.counter", b'{"heartbeat_counter": 0}'), *self._received])

    def _request(self, frames: list[bytes]) -> None:
        self.requests.append(frames)
        if self._answer is not None:
            said = self._answer(json.loads(frames[2]), len(self.requests))
            self._publish(self._report, [(b"confirm.cam.", json.dumps(one).encode()) for one in said])

    def _publish(self, publisher: "zmq.Socket[bytes]", messages: Sequence[Frames]) -> None:
        for frames in messages:
            publisher.send_multipart(frames)


class FakeControl:
    """A control socket that answers each line with the same one."""

    def __init__(self, path: Path, answer: bytes) -> None:
        self.path = path
        self.lines: list[bytes] = []
        self._answer = answer
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.bind(str(path))
        self._socket.listen(4)
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> "FakeControl":
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
        self._thread.join()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._socket.accept()
            except OSError:
                return
            with connection, contextlib.suppress(BrokenPipeError):  # a client may leave without an answer
                self.lines.append(connection.recv(4096))
                connection.sendall(self._answer)
