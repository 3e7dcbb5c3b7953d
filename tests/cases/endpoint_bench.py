"""Sockets of an endpoint under attack, on a loop whose clock moves by what a test turns."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from typing import Any

import pytest
import zmq

from drivers.message import MessageType
from drivers.reason import Reason
from firmware.endpoint.inlet import Inlet
from firmware.endpoint.peers.guard import Guard
from firmware.endpoint.peers.interest import CountedTopics
from firmware.endpoint.publisher import Publisher
from firmware.routing.drops import Drops
from firmware.routing.router import Routing
from firmware.topics import Topics
from tests.hostile import PATIENCE_S, Peer, frame
from tests.virtual import VirtualLoop

CAM = bytes((2, 2)) + bytes(300)
PART = frame(bytes(60_000), more=True)
INLETS = pytest.mark.parametrize("kind", ["push", "pub"])


class Counting:
    """A router that counts."""

    def __init__(self) -> None:
        self.taken = self.refused = 0

    def request(self, kind: MessageType, pdu: bytes, where: str, asked: object = None) -> None:
        self.taken += 1

    def refuse_message(self, *refused: Any, **more: Any) -> None:
        self.refused += 1


class Bench:
    """The four sockets of an endpoint and their guard, on a loop whose clock moves by what a test turns."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.context = zmq.Context()
        self.drops = Drops()
        self.router = Counting()
        self.wanted: dict[bytes, bool] = {}
        routing = Routing(loop, Topics(), self.drops, self.router)  # type: ignore[arg-type]
        self.inlets = {
            name: Inlet(
                routing,
                self.context,
                kind,
                "tcp://127.0.0.1:0",
                where,
            )
            for name, kind, where in (("push", zmq.PULL, "pull"), ("pub", zmq.SUB, "from_users"))
        }
        counted = CountedTopics((b"v2x.",), self.wanted.__setitem__)
        self.publisher = Publisher(loop, self.context, "tcp://127.0.0.1:0", "to_users", self.drops, counted)
        self.guard = Guard(loop, list(self.inlets.values()), [self.publisher])
        self.peers: list[Peer] = []

    def peer(self, kind: str = "sub", of: type[Peer] = Peer) -> Peer:
        socket_of = self.publisher if kind == "sub" else self.inlets[kind]
        port = int(socket_of._socket.get(zmq.LAST_ENDPOINT).rstrip(b"\0").rpartition(b":")[2])
        self.peers.append(peer := of(port, kind.upper().encode(), self.loop.turn))
        return peer

    def until(self, holds: Callable[[], bool]) -> None:
        """libzmq has a thread of its own: it has time while nothing is ready."""
        self.loop.patience_s = 0.001
        end = time.monotonic() + PATIENCE_S
        while not holds():
            assert time.monotonic() < end, f"not so within {PATIENCE_S} s"
            self.loop.after(0.01, lambda: None)
            self.loop.turn()

    def count(self, where: str, reason: Reason) -> int:
        return self.drops.total(where, reason)

    def open(self) -> int:
        return sum(len(one.door.connections) for one in (*self.inlets.values(), self.publisher))

    def close(self) -> None:
        for peer in self.peers:
            peer.close()
        for one in (*self.inlets.values(), self.publisher):
            one.close()
        self.guard.close()
        self.context.destroy(0)


@pytest.fixture
def bench() -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop)) as bench:
        yield bench


def push(peer: Peer, count: int) -> None:
    peer.socket.sendall((frame(b"v2x.cam.", more=True) + frame(CAM)) * count)


def flood(bench: Bench, rude: Peer, first: bytes) -> None:
    """Messages of one subscriber until it is ended for that; of one topic: their number does not end it."""
    octets = frame(first + b"same".ljust(200)) * 1000
    rude.socket.settimeout(0.001)

    def is_ended() -> bool:
        with suppress(TimeoutError):
            rude.socket.sendall(octets)
        return bench.count("to_users", Reason.SUBSCRIBER_FLOOD) == 1

    with suppress(OSError):
        bench.until(is_ended)
    bench.until(lambda: bench.count("to_users", Reason.SUBSCRIBER_FLOOD) == 1)


def is_cut_while_sending(peer: Peer) -> bool:
    """As Peer.is_cut(). A look at its last octets may come before libzmq has read them: so there are others."""
    with suppress(OSError):
        peer.socket.sendall(frame(b"", more=True))
    return peer.is_cut()
