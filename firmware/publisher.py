"""A socket that publishes: it knows what is subscribed to, and notices when a subscriber does not keep up."""

import errno
import logging
import os
import time
from collections import deque
from collections.abc import Callable, Container, Iterable, Sequence

import zmq
from zmq.backend import Socket as PlainSocket

from board.errors import InterfaceError
from board.loop import Loop
from drivers.reason import Reason
from firmware.drops import Drops
from firmware.peers.connection import Connection
from firmware.peers.door import Door, descriptor_of, is_readable
from firmware.peers.interest import Interest
from firmware.peers.limits import (
    HEARTBEAT_MS,
    HEARTBEAT_TIMEOUT_MS,
    QUEUE,
    SUBSCRIBER_MESSAGE,
    TOPIC,
    TOPICS_LOCAL,
    TOPICS_OUTSIDE,
    TOPICS_TOTAL,
)

# The methods of the plain socket: the wrappers of zmq.Socket cost 0.8 us a frame more.
_send = PlainSocket.send
_recv = PlainSocket.recv
NOBLOCK = int(zmq.NOBLOCK)
MORE = int(zmq.SNDMORE | zmq.NOBLOCK)
# Subscriptions taken in one turn: a client that sends nothing else must not hold up the rest.
BATCH = 2
# Octets that the kernel holds of one subscriber: libzmq still takes these when the connection has been ended.
SUBSCRIBER_BUFFER = 2048
SUBSCRIPTIONS = 1  # of one subscriber that wait in libzmq: it takes them while they come, whatever the loop has to do
EACH = 256  # messages, after which on_sent is called
LOOK_S = 0.01  # a new subscription waits no longer than this while messages flow
LINGER_MS = 200  # what is still unsent when the station stops

log = logging.getLogger("captain.publisher")


BIND_HINTS = {
    errno.EADDRINUSE: "another station or program may have it: captain status, ss -ltnp; or choose another port",
    errno.EACCES: "ports below 1024 are for privileged users; choose another",
}


def bind(socket: zmq.Socket[bytes], address: str, option: str) -> None:
    """Bind, or say which option of captain.toml names an address that is taken or does not exist."""
    try:
        socket.bind(address)
    except zmq.ZMQError as error:
        socket.close(0)
        number = error.errno or 0
        hint = BIND_HINTS.get(number, "it must be an address of this host")
        raise InterfaceError(f"{option}: cannot bind {address}: {os.strerror(number)}", hint) from error


def beat(socket: zmq.Socket[bytes]) -> None:
    """Let ZMTP's heartbeat end connections of peers that do not answer."""
    socket.set(zmq.HEARTBEAT_IVL, HEARTBEAT_MS)
    socket.set(zmq.HEARTBEAT_TIMEOUT, HEARTBEAT_TIMEOUT_MS)


class Publisher:
    """An XPUB socket; on the wire it is a PUB.

    place   its key in [endpoint], which is also where its drops are counted: to_users, report or ipc_out.
    topics  of which on_interest tells with each subscriber that comes, and when the last goes: topic, whether wanted.
    whole   topics as they are sent, of which wants() tells.
    costly  of topics, those that a subscription to everything does not ask for.
    also    further addresses to bind; of Unix sockets, those of all addresses are for programs of the same user alone.

    libzmq drops for a slow subscriber alone and counts nothing. So the socket refuses first (XPUB_NODROP): the
    refusal is the word that a subscriber is slow, then the message is sent again, dropping for that one.
    """

    def __init__(
        self,
        loop: Loop,
        context: zmq.Context[zmq.Socket[bytes]],
        address: str,
        place: str,
        drops: Drops,
        topics: tuple[bytes, ...] = (),
        on_interest: Callable[[bytes, bool], None] = lambda topic, is_wanted: None,
        whole: Iterable[bytes] = (),
        costly: Container[bytes] = (),
        also: Sequence[str] = (),
    ) -> None:
        self.slow_since: float | None = None
        self.slow_count = 0
        self.sent = 0  # messages
        self.on_sent: Callable[[], None] = lambda: None
        self._next = EACH
        self._loop = loop
        self._place = place
        self._drops = drops
        self._interest = Interest(topics, whole, costly, on_interest)
        self._taken: deque[tuple[int, bytes]] = deque()  # whoever hears of interest may send, and so look, at once
        self._unnamed: set[bytes] = set()  # topics of subscriptions without a descriptor
        self._is_looking = False  # a timer waits
        self._is_scheduled = False  # subscriptions are being taken, or more of them in the next turn
        self._socket = context.socket(zmq.XPUB)
        self._socket.set(zmq.SNDHWM, QUEUE)
        self._socket.set(zmq.LINGER, LINGER_MS)
        self._socket.set(zmq.XPUB_NODROP, 1)
        # Every subscription, not only the first of its prefix, and each end of one. Not XPUB_MANUAL: libzmq 4.3.5 keeps
        # the pipe of one that nobody has read yet, and uses it after its subscriber has gone and it was freed
        # (valgrind); and it puts subscriptions down to the wrong subscriber when another sends what is none.
        self._socket.set(zmq.XPUB_VERBOSER, 1)
        self._socket.set(zmq.MAXMSGSIZE, SUBSCRIBER_MESSAGE)
        self._socket.set(zmq.RCVHWM, SUBSCRIPTIONS)
        self._socket.set(zmq.RCVBUF, SUBSCRIBER_BUFFER)
        self._socket.set(zmq.IPV6, int("[" in address))
        if address.startswith("tcp:"):
            beat(self._socket)
        if also:  # an abstract Unix socket has no file whose rights would decide
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
        """Hand a message of two frames to the socket; a slow subscriber loses it, the others do not."""
        self.publish_all(((topic, body),))

    def publish_all(self, messages: Iterable[tuple[bytes, bytes]]) -> None:
        """As publish(), one after the other."""
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
        """As publish(), a message of three frames."""
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
        """As publish(), but nobody has it while one that wants it does not keep up; whether it was handed over."""
        try:
            _send(self._socket, topic, MORE)
        except zmq.Again:
            return False
        _send(self._socket, body, NOBLOCK)
        if not self._is_looking:
            self._look_soon()
        return True

    def wants(self, topic: bytes) -> bool:
        """Whether anybody who has subscribed until now would get a message of this topic, one of the whole ones."""
        if not self._interest.takers[topic]:
            self.look()
        return self._interest.takers[topic] > 0

    def close(self) -> None:
        """Idempotent."""
        if not self._socket.closed:
            self._loop.remove(self)
            self.door.close()
            self._socket.close()

    def look(self) -> None:
        """Take the subscriptions that have come until now, where the next message depends on them (1.3 us).

        Of a flood one batch is taken in a turn: then only what was taken takes effect.
        """
        if self._taken:
            self._apply()
        if not self._is_scheduled and is_readable(self._socket):
            self._look()

    def _look_soon(self) -> None:
        # A send may swallow the edge that announces a subscription: look again soon. A look costs as much as four
        # sends, so one for all messages of LOOK_S.
        self._is_looking = True
        self._loop.after(LOOK_S, self._look_now)

    def _look_now(self) -> None:
        self._is_looking = False
        self._look()

    def _go_on(self) -> None:
        self._is_scheduled = False
        self._look()

    def _look(self) -> None:
        """Take a batch of the subscriptions that have come; the one continuation of it takes the next."""
        if self._is_scheduled or self._socket.closed:
            return
        if self.sent >= self._next:
            self._next = self.sent + EACH
            self.on_sent()
        self._is_scheduled = True
        is_more = self._take() == BATCH
        self._apply()
        self._is_scheduled = is_more
        if is_more:
            self._loop.soon(self._go_on)

    def _apply(self) -> None:
        """Let what was taken take effect. Whoever hears of interest may ask for this again."""
        if self._taken:
            self.door.settle()  # after the messages: see Door
        while self._taken:
            self._subscription(*self._taken.popleft())

    def _take(self) -> int:
        """Take what subscribers have sent, at most BATCH, with libzmq's descriptor of each; -1 where there is none."""
        taken = 0
        while taken < BATCH and is_readable(self._socket):
            frame = _recv(self._socket, NOBLOCK, False)
            self._taken.append((descriptor_of(frame), frame.bytes))
            taken += 1
        return taken

    def _subscription(self, descriptor: int, message: bytes) -> None:
        """First octet 1 subscribes, 0 unsubscribes, the prefix follows; anything else is a user's, not for us."""
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
        """Count a subscription, or end the connection that has too many topics: libzmq cannot take one back."""
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
        """Count a subscription of ZMTP 2.0, or end the likeliest of those that may have sent it: none is told."""
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
        """End the connection with most topics, of an address or of all, and take its topics back."""
        some = [one for one in self.door.connections.values() if address in ("", one.address)]
        largest = max(some, key=lambda one: len(one.topics))
        self.door.cut(largest, Reason.TOPICS, topic, detail)
        self._interest.end(largest)

    def _gone(self, connection: Connection) -> None:
        """Its connection has ended; whoever was slow may have been it."""
        self.slow_since = None
        self._interest.end(connection)

    def _publish_dropping(self, topic: bytes, *bodies: bytes) -> None:
        """Hand it to those that keep up. libzmq passes the others by until each has read half of what waits for it.

        So one that never reads again is refused, and counted, but once; that it does is known only when it leaves.
        """
        self.slow_count += 1
        self._drops.count(self._place, Reason.SUBSCRIBER_SLOW, bodies[0])
        if self.slow_since is None:
            self.slow_since = time.time()
            log.warning("%s: a subscriber does not keep up: it alone loses messages", self._place)
        self._socket.set(zmq.XPUB_NODROP, 0)
        _send(self._socket, topic, MORE)
        for body in bodies[:-1]:
            _send(self._socket, body, MORE)
        _send(self._socket, bodies[-1], NOBLOCK)
        self._socket.set(zmq.XPUB_NODROP, 1)
