"""Feed: received messages for the facilities process, on a private ZeroMQ socket."""

import os
from collections.abc import Iterable

import zmq
from zmq.backend import Socket as PlainSocket

from drivers.message import Indication, Position
from firmware.endpoint.report import run_id, said_of
from firmware.facilities.exchange import Received, packed

# Messages that wait on each side of the socket. A process that falls behind loses later ones, and counts them by their
# numbers.
QUEUE = 256

_send = PlainSocket.send
_recv = PlainSocket.recv
NOBLOCK = int(zmq.NOBLOCK)


class Feed:
    """Publishing socket for one subscriber: a process of the same user.

    address  its ZeroMQ address, an abstract Unix socket.
    sent     number of messages for this process; it receives the number with each message.
    """

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]]) -> None:
        self.address = f"ipc://@captain-{os.urandom(8).hex()}"
        self.sent = 0
        self._subscriptions = 0
        self._socket = context.socket(zmq.XPUB)
        self._socket.set(zmq.XPUB_VERBOSER, 1)
        self._socket.set(zmq.SNDHWM, QUEUE)
        self._socket.set(zmq.LINGER, 0)
        self._socket.set(zmq.IPC_FILTER_UID, os.geteuid())
        self._socket.bind(self.address)

    def begin(self) -> None:
        """Number the messages for a new process from 1."""
        self.sent = 0

    def send(self, one: Indication, sequence: int) -> bool:
        """Send a message; return False if no process has subscribed yet.

        sequence  number of the message among the delivered ones of its type.
        """
        if not self.sent and not self._has_subscriber():
            return False
        self.sent += 1
        _send(self._socket, packed(*received_of(one, sequence, self.sent)), NOBLOCK)
        return True

    def close(self) -> None:
        self._socket.close(0)

    def _has_subscriber(self) -> bool:
        while True:
            try:
                self._subscriptions += 1 if _recv(self._socket, NOBLOCK)[0] else -1
            except zmq.Again:
                return self._subscriptions > 0


def types_of(topics: Iterable[bytes]) -> frozenset[str]:
    """Return the message types of topics such as b"json.cam."."""
    return frozenset(topic.split(b".")[1].decode() for topic in topics)


def received_of(one: Indication, sequence: int, number: int = 0) -> Received:
    """Return a message for a user of port 5558: its number among the delivered ones of its type, and in the feed."""
    rx = one.rx
    is_known = rx.position != Position()
    return Received(
        number,
        run_id(),
        sequence,
        one.kind.name,
        one.pdu,
        one.interface,
        one.received_ns,
        rx.btp_port,
        rx.rssi_dbm,
        rx.sender,
        rx.position.latitude if is_known else None,
        rx.position.longitude if is_known else None,
        rx.security.status.name,
        said_of(one.quality),
        tuple(map(str, rx.implausible)),
    )
