"""Door: open connections of one endpoint socket, reported by libzmq's monitor."""

import itertools
import os
import struct
from collections.abc import Callable

import zmq
from zmq.backend import Socket as PlainSocket
from zmq.backend import zmq_poll

from board.runtime.loop import Loop
from drivers.reason import Reason
from firmware.endpoint.peers.connection import Connection
from firmware.routing.drops import Drops

_recv = PlainSocket.recv
READABLE, NOBLOCK = int(zmq.POLLIN), int(zmq.NOBLOCK)
# Layout of an event's first frame: event number and value, here the descriptor (zmq_socket_monitor(3)).
EVENT = struct.Struct("=HI")
ACCEPTED, ENDED = int(zmq.EVENT_ACCEPTED), int(zmq.EVENT_DISCONNECTED)
SOURCE = int(zmq.SRCFD)  # property of a message: descriptor of its connection (zmq_msg_get(3))
BATCH = 2  # number of monitor events that are taken per turn of the loop
_numbers = itertools.count()


def is_readable(socket: "zmq.Socket[bytes]") -> bool:
    """Return True if a message can be read. The call also clears the edge of the socket's descriptor.

    libzmq processes subscriptions inside this call for as long as they arrive. The socket option EVENTS is not used:
    pyzmq holds the interpreter's lock while it reads that option, so the thread that ends a flood could not run.
    """
    return bool(zmq_poll([(socket, READABLE)], 0))


def descriptor_of(frame: zmq.Frame) -> int:
    """Return libzmq's descriptor of the connection of a message; -1 if it has none."""
    try:
        return int(frame.get(SOURCE))
    except zmq.ZMQError:
        return -1


class Door:
    """Open connections of a socket, by libzmq's descriptor.

    name    name of the socket, the place of its drop counters.
    opened  functions that are called with each new connection.
    closed  functions that are called with each closed connection.
    drops   counters for connections that this station ended.

    libzmq's thread reports the end of a connection before it closes the descriptor, and a new connection before it
    reads from it. A caller that first reads messages and then calls settle() therefore finds their connections, even if
    a descriptor number is reused.
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
        self.heard: set[int] = set()  # descriptors of delivered messages; -1 means any connection by ZMTP 2.0
        self.unnamed = 0  # number of octets of messages whose connection libzmq did not name
        self.opened: list[Callable[[Connection], None]] = []
        self.closed: list[Callable[[Connection], None]] = []
        self._drops = drops
        self._loop = loop
        self._socket = socket
        address = f"inproc://door-{id(self)}-{next(_numbers)}"
        socket.monitor(address, ACCEPTED | ENDED)
        self._monitor = context.socket(zmq.PAIR)
        self._monitor.set(zmq.RCVHWM, 0)  # unlimited: a full queue would block libzmq's thread
        self._monitor.set(zmq.LINGER, 0)
        self._monitor.connect(address)
        self._is_scheduled = False
        is_readable(self._monitor)  # connect() has set the edge: unless it is cleared, no further edge follows
        loop.add(self)

    def fileno(self) -> int:
        return self._monitor.fileno()

    def ready(self, events: int = 0) -> None:
        """Take a batch of monitor events. The descriptor is edge-triggered, so the next turn takes the rest."""
        if not self._is_scheduled:
            self._go_on()

    def settle(self) -> None:
        """Take all monitor events that have arrived, so that connections is up to date."""
        if not self._monitor.closed:
            while self._take():
                pass

    def cut(self, connection: Connection, reason: Reason, sample: bytes = b"", detail: str = "") -> None:
        """End a connection and count this as a drop, once per connection."""
        if not connection.is_cut:
            connection.cut()
            self.count(connection, reason, sample, detail)

    def count(self, connection: Connection, reason: Reason, sample: bytes = b"", detail: str = "") -> None:
        """Count the end of a connection as a drop, with its peer in the detail."""
        self._drops.count(self.name, reason, sample, detail=f"{connection.peer}: {detail}")

    def close(self) -> None:
        """Stop the monitor; call this before the socket is closed. A second call has no effect."""
        if self._monitor.closed:
            return
        self._loop.remove(self)
        if not self._socket.closed:
            self._socket.monitor(None, 0)  # an address of None ends the monitor
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
