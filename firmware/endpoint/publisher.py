"""Publisher: a ZeroMQ socket that knows its subscriptions and detects slow subscribers."""

import errno
import logging
import os
import time
from collections import deque
from collections.abc import Iterable, Sequence

import zmq
from zmq.backend import Socket as PlainSocket

from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from drivers.reason import Reason
from firmware.endpoint.peers.connection import Connection
from firmware.endpoint.peers.door import Door, descriptor_of, is_readable
from firmware.endpoint.peers.guard import SubscriberWatch
from firmware.endpoint.peers.interest import CountedTopics, Interest
from firmware.endpoint.peers.limits import (
    HEARTBEAT_MS,
    HEARTBEAT_TIMEOUT_MS,
    QUEUE,
    SUBSCRIBER_MESSAGE,
    TOPIC,
    TOPICS_LOCAL,
    TOPICS_OUTSIDE,
    TOPICS_TOTAL,
)
from firmware.routing.drops import Drops

# Methods of the base class of zmq.Socket. The wrappers in zmq.Socket cost 0.8 us more per frame.
_send = PlainSocket.send
_recv = PlainSocket.recv
NOBLOCK = int(zmq.NOBLOCK)
MORE = int(zmq.SNDMORE | zmq.NOBLOCK)
# Number of subscriptions taken per turn of the loop: a program that floods the socket with them must not delay other
# work.
BATCH = 2
# Octets that the kernel buffers from one subscriber. It is small, because libzmq still reads them after the connection
# was ended.
SUBSCRIBER_BUFFER = 2048
SUBSCRIPTIONS = 1  # messages of one subscriber that libzmq reads in advance, independently of the loop
EACH = 256  # number of sent messages between two checks for stalled subscribers
LOOK_S = 0.01  # longest delay until a new subscription is taken while messages are sent
LINGER_MS = 200  # time for libzmq to send queued messages when the station stops

log = logging.getLogger("captain.publisher")


BIND_HINTS = {
    errno.EADDRINUSE: "another station or program may use it: captain status, ss -ltnp; or choose another port",
    errno.EACCES: "ports below 1024 are for privileged users; choose a higher one",
}


def bind(socket: zmq.Socket[bytes], address: str, option: str) -> None:
    """Bind a socket to an address; close it on failure.

    option  option of captain.toml that holds the address, for the message.

    Raises InterfaceError if the address is in use or does not exist.
    """
    try:
        socket.bind(address)
    except zmq.ZMQError as error:
        socket.close(0)
        number = error.errno or 0
        hint = BIND_HINTS.get(number, "use an address of this host")
        raise InterfaceError(f"{option}: cannot bind {address}: {os.strerror(number)}", hint) from error


def beat(socket: zmq.Socket[bytes]) -> None:
    """Enable ZMTP heartbeats, which end connections of peers that do not answer."""
    socket.set(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    socket.set(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)


class Publisher:
    """Publishing socket. Its type is XPUB, which subscribers see as PUB.

    place    key of its address in [endpoint], also the place of its drop counters: to_users, report or ipc_out.
    counted  topics whose subscribers are counted.
    also     further addresses to bind. With any, Unix sockets accept only programs of the same user.

    By default, libzmq drops messages of a slow subscriber without counting them. With the option XPUB_NODROP, libzmq
    refuses such a message instead, which shows that a subscriber is slow. The message is then sent again without the
    option, so that only the slow subscriber loses it.

    Raises InterfaceError if an address cannot be bound.
    """

    def __init__(
        self,
        loop: Loop,
        context: zmq.Context[zmq.Socket[bytes]],
        address: str,
        place: str,
        drops: Drops,
        counted: CountedTopics,
        also: Sequence[str] = (),
    ) -> None:
        self.slow_since: float | None = None
        self.slow_count = 0
        self.sent = 0  # messages
        self.subscriber_watch: SubscriberWatch | None = None
        self._next = EACH
        self._loop = loop
        self._place = place
        self._drops = drops
        self._interest = Interest(counted)
        # Subscriptions that were read and not yet applied: descriptor and message. They are queued, because applying
        # one may send a message, which may in turn read further subscriptions.
        self._taken: deque[tuple[int, bytes]] = deque()
        self._unnamed: set[bytes] = set()  # topics of subscriptions whose connection libzmq did not name
        self._is_looking = False  # True while a timer for the next check for subscriptions is set
        self._is_closed = False
        self._is_scheduled = False  # True while subscriptions are read, or will be read in the next turn
        self._socket = context.socket(zmq.XPUB)
        self._socket.set(zmq.SNDHWM, QUEUE)
        self._socket.set(zmq.LINGER, LINGER_MS)
        self._socket.set(zmq.XPUB_NODROP, 1)
        # With XPUB_VERBOSER, libzmq reports every subscription and its end, not only the first of a prefix. XPUB_MANUAL
        # is not used: if a subscriber leaves before its subscription is read, libzmq 4.3.5 uses its freed pipe
        # (valgrind). XPUB_MANUAL also attributes subscriptions to a wrong subscriber if another one sends other data.
        self._socket.set(zmq.XPUB_VERBOSER, 1)
        self._socket.set(zmq.MAXMSGSIZE, SUBSCRIBER_MESSAGE)
        self._socket.set(zmq.RCVHWM, SUBSCRIPTIONS)
        self._socket.set(zmq.RCVBUF, SUBSCRIBER_BUFFER)
        self._socket.set(zmq.IPV6, int("[" in address))
        if address.startswith("tcp:"):
            beat(self._socket)
        if also:  # an abstract Unix socket has no file permissions that would exclude other users
            self._socket.set(zmq.IPC_FILTER_UID, os.geteuid())
        self.door = Door(loop, context, self._socket, place, drops)
        self.door.closed.append(self._gone)
        try:
            for one in (*also, address):
                bind(self._socket, one, f"endpoint.{place}")
        except InterfaceError:
            self.door.close()
            raise
        loop.add(self)

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        self._look()

    def publish(self, topic: bytes, body: bytes) -> None:
        """Send a message of two frames to all subscribers of its topic; slow subscribers lose it."""
        self.publish_all(((topic, body),))

    def publish_all(self, messages: Iterable[tuple[bytes, bytes]]) -> None:
        """Send messages of two frames, one after the other, as publish() does."""
        socket = self._socket
        for topic, body in messages:
            self.sent += 1
            try:
                _send(socket, topic, MORE)
            except zmq.Again:
                self._publish_dropping(topic, body)
            else:
                _send(socket, body, NOBLOCK)
        if not self._is_looking:
            self._look_soon()

    def publish_both(self, topic: bytes, body: bytes, octets: bytes) -> None:
        """Send a message of three frames, as publish() does with two."""
        self.sent += 1
        try:
            _send(self._socket, topic, MORE)
        except zmq.Again:
            self._publish_dropping(topic, body, octets)
        else:
            _send(self._socket, body, MORE)
            _send(self._socket, octets, NOBLOCK)
        if not self._is_looking:
            self._look_soon()

    def offer(self, topic: bytes, body: bytes) -> bool:
        """Send a message of two frames unless one of its subscribers is slow. Return True if it was sent."""
        try:
            _send(self._socket, topic, MORE)
        except zmq.Again:
            return False
        _send(self._socket, body, NOBLOCK)
        if not self._is_looking:
            self._look_soon()
        return True

    def add_costly(self, topics: Iterable[bytes]) -> None:
        """Count subscriptions to further topics, as those of CountedTopics.topics that are costly."""
        self._interest.add_costly(topics, self._prefixes())

    def wants(self, topic: bytes) -> bool:
        """Return True if a subscriber would receive this complete topic: one of CountedTopics.whole, or another."""
        if topic not in self._interest.takers:
            self._interest.add_whole(topic, self._prefixes())
        if not self._interest.takers[topic]:
            self.look()
        return self._interest.takers[topic] > 0

    def _prefixes(self) -> list[bytes]:
        """Return the topics of all subscribers, one for each subscription."""
        return [*self._unnamed, *(topic for one in self.door.connections.values() for topic in one.topics)]

    def close(self) -> None:
        """Close the socket; a second call has no effect."""
        if not self._is_closed:
            self._is_closed = True
            self._loop.remove(self)
            self.door.close()
            self._socket.close()

    def look(self) -> None:
        """Take the subscriptions that have arrived, for a caller that sends only to subscribers (1.3 us).

        In a flood of subscriptions only one batch per turn of the loop takes effect.
        """
        if self._taken:
            self._apply()
        if not self._is_scheduled and is_readable(self._socket):
            self._look()

    def _look_soon(self) -> None:
        # The descriptor is edge-triggered, and a send may clear the edge that announces a subscription. The timer
        # checks for it. A check costs as much as four sends, so there is only one per LOOK_S.
        self._is_looking = True
        self._loop.after(LOOK_S, self._look_now)

    def _look_now(self) -> None:
        self._is_looking = False
        self._look()

    def _go_on(self) -> None:
        self._is_scheduled = False
        self._look()

    def _look(self) -> None:
        """Take a batch of subscriptions; if there may be more, take the next batch in the next turn of the loop."""
        if self._is_scheduled or self._is_closed:
            return
        if self.sent >= self._next:
            self._next = self.sent + EACH
            if self.subscriber_watch is not None:
                self.subscriber_watch.look()
        self._is_scheduled = True
        is_more = self._take() == BATCH
        self._apply()
        self._is_scheduled = is_more
        if is_more:
            self._loop.soon(self._go_on)

    def _apply(self) -> None:
        """Apply the subscriptions that were read. A callback for changed interest may call this method again."""
        if self._taken:
            self.door.settle()  # after the read, so that the door knows the connections of these subscriptions
        while self._taken:
            self._subscription(*self._taken.popleft())

    def _take(self) -> int:
        """Read up to BATCH messages of subscribers into the queue and return their number."""
        taken = 0
        while taken < BATCH and is_readable(self._socket):
            frame = _recv(self._socket, NOBLOCK, False)
            self._taken.append((descriptor_of(frame), frame.bytes))
            taken += 1
        return taken

    def _subscription(self, descriptor: int, message: bytes) -> None:
        """Apply a message of a subscriber: octet 1 subscribes, 0 unsubscribes; the topic prefix follows.

        Other messages are ignored. descriptor: libzmq's descriptor of the connection; negative if it is unknown.
        """
        connection = self.door.connections.get(descriptor)
        if connection is not None:
            connection.is_used = True
        self.door.heard.add(descriptor)
        if message[:1] not in (b"\0", b"\1"):
            return
        is_wish, prefix = bool(message[0]), message[1:]
        if not is_wish:
            self.slow_since = None
        if connection is not None:
            if is_wish:
                self._subscribe(connection, prefix)
            else:
                self._interest.unsubscribe(connection, prefix)
        elif descriptor < 0 and is_wish:
            self._subscribe_unnamed(prefix)

    def _subscribe(self, connection: Connection, topic: bytes) -> None:
        """Count a subscription. libzmq cannot refuse one, so if there are too many, a connection is ended."""
        if connection.is_cut:
            return
        if len(topic) > TOPIC:
            self.door.cut(connection, Reason.TOPICS, topic, f"topic of {len(topic)} octets; at most {TOPIC}")
            return
        interest, address = self._interest, connection.address
        interest.subscribe(connection, topic)
        most = TOPICS_LOCAL if connection.is_local else TOPICS_OUTSIDE
        if interest.by_address[address] > most:
            self._end_largest(f"{interest.by_address[address]} topics of this address; at most {most}", topic, address)
        elif interest.total > TOPICS_TOTAL:
            self._end_largest(f"{interest.total} topics of all; at most {TOPICS_TOTAL}", topic)

    def _subscribe_unnamed(self, topic: bytes) -> None:
        """Count a subscription by ZMTP 2.0, for which libzmq does not name the connection.

        If there are too many, end the unused connection that has sent the most octets, as the likeliest sender.
        """
        self._unnamed.add(topic)
        if len(topic) <= TOPIC and len(self._unnamed) <= TOPICS_LOCAL:
            self._interest.add(topic)
            return
        detail = f"{len(self._unnamed)} topics by ZMTP 2.0, at most {TOPICS_LOCAL}, or one above {TOPIC} octets"
        self._unnamed.clear()
        some = [one for one in self.door.connections.values() if one.is_counted and not (one.is_used or one.is_cut)]
        if some:
            self.door.cut(max(some, key=Connection.read), Reason.TOPICS, topic, detail)

    def _end_largest(self, detail: str, topic: bytes, address: str = "") -> None:
        """End the connection with the most topics and remove its topics; with an address, one from that address."""
        some = [one for one in self.door.connections.values() if address in ("", one.address)]
        largest = max(some, key=lambda one: len(one.topics))
        self.door.cut(largest, Reason.TOPICS, topic, detail)
        self._interest.end(largest)

    def _gone(self, connection: Connection) -> None:
        """Remove the topics of an ended connection. It may have been the slow subscriber, so slow_since is reset."""
        self.slow_since = None
        self._interest.end(connection)

    def _publish_dropping(self, topic: bytes, *bodies: bytes) -> None:
        """Send a message to all but the slow subscribers, and count this.

        libzmq then skips a slow subscriber until it has read half of its queue. A subscriber that never reads again is
        therefore counted once.
        """
        self.slow_count += 1
        self._drops.count(self._place, Reason.SUBSCRIBER_SLOW, bodies[0])
        if self.slow_since is None:
            self.slow_since = time.time()
            log.warning("%s: slow subscriber: it alone loses messages", self._place)
        self._socket.set(zmq.XPUB_NODROP, 0)
        _send(self._socket, topic, MORE)
        for body in bodies[:-1]:
            _send(self._socket, body, MORE)
        _send(self._socket, bodies[-1], NOBLOCK)
        self._socket.set(zmq.XPUB_NODROP, 1)
