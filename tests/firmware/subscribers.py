"""Users of a publisher: their sockets, in the context that it has too, and what they have received."""

import zmq

from tests.virtual import VirtualLoop


class Subscribers:
    """Sockets connected to one address; subscribed when join() returns."""

    def __init__(self, loop: VirtualLoop, context: "zmq.Context[zmq.Socket[bytes]]", address: str) -> None:
        self._loop = loop
        self._context = context
        self._address = address
        self._sockets: list[zmq.Socket[bytes]] = []

    def socket(self, kind: int = zmq.SUB) -> "zmq.Socket[bytes]":
        """One that has not subscribed to anything."""
        socket = self._context.socket(kind)
        socket.set(zmq.LINGER, 0)
        socket.connect(self._address)
        self._sockets.append(socket)
        return socket

    def join(self, *prefixes: bytes) -> "zmq.Socket[bytes]":
        subscriber = self.socket()
        for prefix in prefixes:
            subscriber.subscribe(prefix)
        self._loop.run_for(0.05)
        return subscriber

    def close(self) -> None:
        for socket in self._sockets:
            socket.close(0)


def received(subscriber: "zmq.Socket[bytes]") -> list[list[bytes]]:
    messages = []
    while True:
        try:
            messages.append(subscriber.recv_multipart(zmq.NOBLOCK))
        except zmq.Again:
            return messages
