"""Users of a publisher: their sockets, in the context that it has too, and what they have received."""

from collections.abc import Callable

import zmq

from tests.virtual import VirtualLoop


class Subscribers:
    """Sockets connected to one address; subscribed when join() returns.

    total  subscriptions of connections, where the address is not inproc: there libzmq's thread takes its time.
    """

    def __init__(
        self,
        loop: VirtualLoop,
        context: "zmq.Context[zmq.Socket[bytes]]",
        address: str,
        total: Callable[[], int] | None = None,
    ) -> None:
        self._loop = loop
        self._total = total
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
        before = self._total() if self._total is not None else 0
        for prefix in prefixes:
            subscriber.subscribe(prefix)
        self._wait_for(before + len(prefixes))
        return subscriber

    def unsubscribe(self, subscriber: "zmq.Socket[bytes]", *prefixes: bytes) -> None:
        before = self._total() if self._total is not None else 0
        for prefix in prefixes:
            subscriber.unsubscribe(prefix)
        self._wait_for(before - len(prefixes))

    def _wait_for(self, total: int) -> None:
        if (told := self._total) is None:
            self._loop.run_for(0.05)
        else:
            self._loop.patience_s = 1.0
            self._loop.run_until(lambda: told() == total)

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
