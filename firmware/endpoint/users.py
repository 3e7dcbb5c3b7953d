"""Port 5556: publishes `raw.` and `v2x.<type>.` of received messages, and the heartbeat."""

import time
from collections import Counter
from collections.abc import Callable
from typing import Protocol

import zmq

from board.runtime.loop import Loop
from drivers.message import Ego, Indication, Position
from drivers.wire import raw
from firmware.endpoint.peers.interest import CountedTopics
from firmware.endpoint.publisher import Publisher
from firmware.routing.drops import Drops
from firmware.topics import Topics

RAW = b"raw."
HEARTBEAT = b"hb.counter"
HEARTBEAT_S = 1.0


class DeliveryListener(Protocol):
    """Receiver of published messages, for users of port 5558. sequences: number of each one among those of its type."""

    def publish(self, indications: list[Indication], sequences: list[int]) -> None: ...


class Users:
    """Publisher of indications and the heartbeat, the only contents of port 5556.

    local      returns the own position for localInfo of RawRxMessage; None omits localInfo.
    listeners  receive the same messages.
    """

    def __init__(
        self,
        loop: Loop,
        context: zmq.Context[zmq.Socket[bytes]],
        address: str,
        topics: Topics,
        drops: Drops,
        local: Callable[[], Ego] | None,
    ) -> None:
        self.published = 0
        self.raw = 0
        self.listeners: list[DeliveryListener] = []
        self._sequences = Counter[str]()  # number of the last message of each type
        self._is_raw_wanted = False
        self._loop = loop
        self._envelopes = topics.envelopes
        self._local = local
        self.publisher = Publisher(loop, context, address, "to_users", drops, CountedTopics((RAW,), self._interest))
        self._beats = 0

    def start(self) -> None:
        self._loop.every(HEARTBEAT_S, self._beat)

    def publish(self, indications: list[Indication]) -> None:
        """Publish `raw.` with the metadata of each indication, if it has a subscriber, then the PDU unchanged."""
        # A RawRxMessage costs 2 us, so it is built only for subscribers. libzmq applies a subscription inside a send.
        # Without look(), a new subscriber would receive PDUs without their `raw.` for 10 ms.
        if not self._is_raw_wanted:
            self.publisher.look()
        envelopes = self._envelopes
        if self._is_raw_wanted:
            messages = [message for one in indications for message in self._both(one)]
            self.raw += len(indications)
        else:
            messages = [(envelopes[one.kind.row], one.pdu) for one in indications]
        self.publisher.publish_all(messages)
        self.published += len(indications)
        sequences = [self._next(one.kind.name) for one in indications]
        for listener in self.listeners:
            listener.publish(indications, sequences)

    def _next(self, name: str) -> int:
        self._sequences[name] = number = self._sequences[name] + 1
        return number

    def _both(self, one: Indication) -> tuple[tuple[bytes, bytes], tuple[bytes, bytes]]:
        body = raw.build(one.pdu, one.received_ns, one.rx, self._local_info())
        return (RAW, body), (self._envelopes[one.kind.row], one.pdu)

    def _local_info(self) -> tuple[int, Position] | None:
        if self._local is None:
            return None
        ego = self._local()
        return (time.time_ns(), ego.position) if ego.is_known else None

    def _interest(self, topic: bytes, is_wanted: bool) -> None:
        self._is_raw_wanted = is_wanted

    def _beat(self) -> None:
        self.publisher.publish(HEARTBEAT, heartbeat(self._beats))
        self._beats += 1


def heartbeat(count: int) -> bytes:
    """Return the body of a heartbeat: JSON with `count` modulo 65,536."""
    return b'{"heartbeat_counter": %d}' % (count & 0xFFFF)
