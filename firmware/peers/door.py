"""Connections of one socket of the endpoint, as the monitor of libzmq tells of them."""

import itertools
import os
import struct
from collections.abc import Callable

import zmq
from zmq.backend import Socket as PlainSocket
from zmq.backend import zmq_poll

from board.loop import Loop
from drivers.reason import Reason
from firmware.drops import Drops
from firmware.peers.connection import Connection

_recv = PlainSocket.recv
READABLE, NOBLOCK = int(zmq.POLLIN), int(zmq.NOBLOCK)
# First frame of an event: number and value, here the descriptor (zmq_socket_monitor(3)).
EVENT = struct.Struct("=HI")
ACCEPTED, ENDED = int(zmq.EVENT_ACCEPTED), int(zmq.EVENT_DISCONNECTED)
SOURCE = int(zmq.SRCFD)  # of a message: the descriptor that it came by
BATCH = 2  # events in one turn
_numbers = itertools.count()


def is_readable(socket: "zmq.Socket[bytes]") -> bool:
    """Whether a message waits; asking also takes the edge off the socket's descriptor.

    libzmq takes subscriptions in here, for as long as they come. So not EVENTS, in which pyzmq holds the interpreter's
    lock: the thread that ends a flood could not run.
    """
    return bool(zmq_poll([(socket, READABLE)], 0))


def descriptor_of(frame: zmq.Frame) -> int:
    """libzmq's descriptor of the connection that a message came by; -1 where it came by none."""
    try:
        return int(frame.get(SOURCE))
    except zmq.ZMQError:
        return -1


class Door:
    """The connections that are open, by libzmq's descriptor.

    name    of the socket: where its drops are counted.
    opened, closed  are called with each connection that comes and goes.
    drops   counts connections that are ended.

    libzmq's one thread tells of an end before it closes the descriptor, and of an acceptance before it reads. So a
    caller that takes messages first, and settles then, knows whose they are: a number that is used again names its
    new owner.
    """

    def __init__(
        self,
        loop: Loop,
        context: "zmq.Context[zmq.Socket[bytes]]",
        socket: "zmq.Socket[bytes]",
        name: str,
        drops: Drops,
    ) -> None:
        self.name = name
        self.connections: dict[int, Connection] = {}
        self.heard: set[int] = set()  # descriptors whose messages were delivered; -1: one of ZMTP 2.0
        self.unnamed = 0  # octets of messages that were delivered without a descriptor
        self.opened: list[Callable[[Connection], None]] = []
        self.closed: list[Callable[[Connection], None]] = []
        self._drops = drops
        self._loop = loop
        self._socket = socket
        address = f"inproc://door-{id(self)}-{next(_numbers)}"
        socket.monitor(address, ACCEPTED | ENDED)
        self._monitor = context.socket(zmq.PAIR)
        self._monitor.set(zmq.RCVHWM, 0)  # a full queue would stop libzmq's thread
        self._monitor.set(zmq.LINGER, 0)
        self._monitor.connect(address)
        self._is_scheduled = False
        is_readable(self._monitor)  # takes the edge off that connecting has left: else no other comes
        loop.add(self)

    def fileno(self) -> int:
        return self._monitor.fileno()

    def ready(self, events: int = 0) -> None:
        """Take a batch of events; the descriptor tells of an edge only."""
        if not self._is_scheduled:
            self._go_on()

    def settle(self) -> None:
        """Take all events that have come until now."""
        if not self._monitor.closed:
            while self._take():
                pass

    def cut(self, connection: Connection, reason: Reason, sample: bytes = b"", detail: str = "") -> None:
        """End a connection and count it."""
        if not connection.is_cut:
            connection.cut()
            self.count(connection, reason, sample, detail)

    def count(self, connection: Connection, reason: Reason, sample: bytes = b"", detail: str = "") -> None:
        """Count the end of a connection."""
        self._drops.count(self.name, reason, sample, detail=f"{connection.peer}: {detail}")

    def close(self) -> None:
        """Idempotent. Before the socket is closed."""
        if self._monitor.closed:
            return
        self._loop.remove(self)
        if not self._socket.closed:
            self._socket.monitor(None, 0)  # no address ends it
        self._monitor.close(0)
        for connection in list(self.connections.values()):
            self._end(connection.descriptor)

    def _go_on(self) -> None:
        self._is_scheduled = False
        if self._monitor.closed:
            return
        for _ in range(BATCH):
            if not self._take():
                return
        self._is_scheduled = True
        self._loop.soon(self._go_on)

    def _take(self) -> bool:
        if not is_readable(self._monitor):
            return False
        event, descriptor = EVENT.unpack(_recv(self._monitor, NOBLOCK))
        endpoint = _recv(self._monitor, NOBLOCK)
        if event == ACCEPTED:
            self._end(descriptor)
            connection = self.connections[descriptor] = Connection(descriptor, os.fsdecode(endpoint), self.name)
            for call in self.opened:
                call(connection)
        elif event == ENDED:
            self._end(descriptor)
        return True

    def _end(self, descriptor: int) -> None:
        if (connection := self.connections.pop(descriptor, None)) is not None:
            self.heard.discard(descriptor)
            for call in self.closed:
                call(connection)
            connection.close()
