"""Guard: limits for the connections of all sockets; ends those that exceed them."""

import select
from collections import defaultdict
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Protocol

from board.runtime.loop import READ, Loop, Timer
from drivers.reason import Reason
from firmware.endpoint.peers.connection import OCTETS_CAME, Connection
from firmware.endpoint.peers.door import Door
from firmware.endpoint.peers.flood import FloodWatch
from firmware.endpoint.peers.limits import HEARTBEATS, QUEUE, UNFINISHED, WAITING, most_connections

# Seconds between two checks: in general, and while a connection has an unfinished message above EARLY octets. The
# pauses are short, because a program on the same machine can fill memory at 4 GB/s.
PAUSE_S, EARLY_S = 0.005, 0.001
EARLY = UNFINISHED // 8
# Octets that all connections by ZMTP 2.0 of a socket may have sent in addition to the delivered messages. libzmq does
# not name these connections. The octets are messages in its queue (10,000 of 1400 octets are 14 MB) and frame headers.
EXCUSED = 32 << 20
ACTIVE = 8  # messages to take in addition to one per connection: libzmq serves in turn, so each connection is served


class Taking(Protocol):
    """Socket that receives messages (firmware.endpoint.inlet.Inlet)."""

    door: Door

    def drain(self, most: int) -> bool: ...


class SubscriberWatch(Protocol):
    """Check of a publisher for subscribers that do not read, called after a fixed number of messages."""

    def look(self) -> None: ...


class Publishing(Protocol):
    """Socket that publishes messages (firmware.endpoint.publisher.Publisher)."""

    door: Door
    sent: int
    subscriber_watch: SubscriberWatch | None


class Guard:
    """Limits for the connections of all sockets together. Idle connections cost no processor time.

    taking      sockets that receive messages.
    publishing  sockets that publish messages.
    """

    def __init__(self, loop: Loop, taking: Sequence[Taking], publishing: Sequence[Publishing]) -> None:
        self.most = most_connections()
        doors = [one.door for one in taking] + [one.door for one in publishing]
        self._doors = {door.name: door for door in doors}
        self._by_address: dict[str, dict[Connection, Door]] = {}  # connections of each address, the oldest first
        self._watches = [_UnfinishedWatch(loop, one) for one in taking]
        self._flood = FloodWatch(loop, self._flooded)
        for door in self._doors.values():
            door.opened.append(self._opened)
            door.closed.append(self._closed)
        for one in publishing:
            one.door.opened.append(self._flood.watch)
            one.door.closed.append(self._flood.forget)
            one.subscriber_watch = _SlowWatch(one)

    def close(self) -> None:
        """Stop the checks; call this after the sockets are closed. A second call has no effect."""
        for watch in self._watches:
            watch.close()
        self._flood.close()

    def status(self) -> dict[str, object]:
        """Return the number of open connections by socket."""
        return {name: len(door.connections) for name, door in self._doors.items()}

    def _opened(self, connection: Connection) -> None:
        """Count a new connection. Above the limit, end a connection of the address with the most connections.

        The oldest unused one is ended, or the oldest if all are used. All Unix sockets count as one address, because
        any program of this machine may connect to an abstract one.
        """
        if connection.fileno() < 0:
            return
        self._by_address.setdefault(connection.address, {})[connection] = self._doors[connection.name]
        if sum(len(some) for some in self._by_address.values()) <= self.most:
            return
        some = max(self._by_address.values(), key=len)
        unused = (one for one, door in some.items() if not (one.is_used or one.descriptor in door.heard))
        one = next(unused, None) or next(iter(some))
        detail = f"{self.most + 1} connections, {len(some)} of this address; at most {self.most}"
        some[one].cut(one, Reason.CONNECTIONS, detail=detail)
        self._closed(one)

    def _closed(self, connection: Connection) -> None:
        some = self._by_address.get(connection.address, {})
        if some.pop(connection, None) is not None and not some:
            del self._by_address[connection.address]

    def _flooded(self, connection: Connection) -> None:
        self._doors[connection.name].count(
            connection, Reason.SUBSCRIBER_FLOOD, detail=f"{connection.sent_at_cut} octets"
        )


class _UnfinishedWatch:
    """Ends connections with an unfinished message that is longer than the limit for messages.

    It waits for octets in its own epoll, which is a source of the loop. After each check it pauses.
    """

    def __init__(self, loop: Loop, taking: Taking) -> None:
        self._loop = loop
        self._taking = taking
        self._door = taking.door
        self._balance = 0.0  # octets that connections by ZMTP 2.0 have sent in addition to the delivered messages
        # Octets that each of these connections has sent since _balance was 0.
        self._excused: defaultdict[Connection, float] = defaultdict(float)
        self._timer: Timer | None = None
        self._watched: dict[int, Connection] = {}  # by the second descriptor
        self._epoll = select.epoll()
        self._door.opened.append(self._watch)
        self._door.closed.append(self._forget)
        loop.add(self)

    def fileno(self) -> int:
        return self._epoll.fileno()

    def ready(self, events: int) -> None:
        active = [self._watched[descriptor] for descriptor, _ in self._epoll.poll(0) if descriptor in self._watched]
        most = self._look(active)
        self._loop.want(self, 0)
        self._timer = self._loop.after(EARLY_S if most > EARLY else PAUSE_S, lambda: self._loop.want(self, READ))

    def close(self) -> None:
        """Stop the checks; a second call has no effect."""
        if not self._epoll.closed:
            if self._timer is not None:
                self._timer.cancel()
            self._loop.remove(self)
            self._epoll.close()

    def _watch(self, connection: Connection) -> None:
        connection.looked_at = self._loop.clock()
        if connection.is_counted:
            self._watched[connection.fileno()] = connection
            with suppress(OSError):
                self._epoll.register(connection.fileno(), OCTETS_CAME)

    def _forget(self, connection: Connection) -> None:
        self._excused.pop(connection, None)
        if self._watched.pop(connection.fileno(), None) is not None and not self._epoll.closed:
            with suppress(OSError):
                self._epoll.unregister(connection.fileno())

    def _look(self, active: Iterable[Connection]) -> float:
        """End active connections above the limit; return the size of the largest unfinished message in octets.

        Finished messages are taken first, so that a fast sender with complete messages is not ended.
        """
        door = self._door
        self._note_heard()
        unfinished = {one: self._unfinished(one) for one in active if not one.is_cut}
        most = max(unfinished.values(), default=0.0)
        suspects = [one for one, octets in unfinished.items() if octets > UNFINISHED]
        if not suspects or not self._taking.drain(len(door.connections) + ACTIVE):
            return most
        heard = self._note_heard()
        for one in suspects:
            if not one.is_cut and one.descriptor not in heard and one.read() - one.mark > UNFINISHED:
                detail = f"{one.read() - one.mark:.0f} octets of one message; at most {UNFINISHED}"
                door.cut(one, Reason.UNFINISHED, detail=detail)
        return most

    def _note_heard(self) -> set[int]:
        """Set `mark` of the connections with delivered messages. Return their descriptors."""
        heard, self._door.heard = self._door.heard, set()
        for descriptor in heard:
            if (one := self._door.connections.get(descriptor)) is not None:
                one.is_used = True
                one.mark = one.read()
        if -1 in heard:
            self._excuse([one for one in self._door.connections.values() if not (one.is_used or one.is_cut)])
        return heard

    def _excuse(self, unnamed: Iterable[Connection]) -> None:
        """Set `mark` of the connections that may have sent a message by ZMTP 2.0, which libzmq does not attribute.

        If these connections together have sent EXCUSED octets more than were delivered, end those that have sent more
        than UNFINISHED.
        """
        self._balance -= self._door.unnamed
        self._door.unnamed = 0
        if self._balance <= 0:
            self._balance = 0.0
            self._excused.clear()
        for one in unnamed:
            read = one.read()
            self._balance += read - one.mark
            self._excused[one] += read - one.mark
            one.mark = read
        if self._balance > EXCUSED:
            for one, octets in self._excused.items():
                if octets > UNFINISHED:
                    self._door.cut(one, Reason.UNFINISHED, detail=f"{octets:.0f} octets by ZMTP 2.0, too few messages")
            self._balance = 0.0
            self._excused.clear()

    def _unfinished(self, one: Connection) -> float:
        """Return the number of octets that libzmq has read since the last delivered message, without heartbeats."""
        read, now = one.read(), self._loop.clock()
        one.mark = min(float(read), one.mark + HEARTBEATS * (now - one.looked_at))
        one.looked_at = now
        return read - one.mark


class _SlowWatch:
    """Check for subscribers that do not read: ends those with the longest queues until the total is below the limit."""

    def __init__(self, publishing: Publishing) -> None:
        self._publishing = publishing

    def look(self) -> None:
        sent, door = self._publishing.sent, self._publishing.door
        connections = [one for one in door.connections.values() if not one.is_cut and one.fileno() >= 0]
        writable = _writable(connections)
        for one in connections:
            one.writable_looks = one.writable_looks + 1 if one.fileno() in writable else 0
            if not one.writable_looks and one.blocked_at is None:
                one.blocked_at = sent
            elif one.writable_looks > 1:  # two checks in a row, because a stalled subscriber may briefly read a little
                one.blocked_at = None
        waiting = {one: min(QUEUE, sent - one.blocked_at) for one in connections if one.blocked_at is not None}
        total = sum(waiting.values())
        for one, count in sorted(waiting.items(), key=lambda pair: -pair[1]):
            if total <= WAITING:
                return
            total -= count
            detail = f"{count} messages wait for it; at most {WAITING} for all subscribers that do not read"
            door.cut(one, Reason.SUBSCRIBER_CUT, detail=detail)


def _writable(connections: Iterable[Connection]) -> set[int]:
    """Return the descriptors of connections to which octets can be written now."""
    poll = select.poll()
    for one in connections:
        if (descriptor := one.fileno()) >= 0:
            poll.register(descriptor, select.POLLOUT)
    return {descriptor for descriptor, _ in poll.poll(0)}
