"""Subscribers that send without end, ended by a thread: libzmq keeps the loop inside one call while they send."""

import os
import select
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from threading import Thread

from board.loop import Loop
from firmware.peers.connection import OCTETS_CAME, Connection
from firmware.peers.limits import HEARTBEATS

# Octets, without heartbeats, that subscribers of one address may send at once, and a second: 512 topics of 256 octets
# are 136 kB. For such a topic the loop's thread is inside libzmq for 80 us.
BURST, REFILL = 160 * 1024, 4 * 1024
# A connection that has sent no more is not ended for what others of its address have sent: the handshake and 30 topics.
SMALL = 1024
PAUSE_S = 0.0005  # of the thread, not of the loop: without it, octets that come without end would keep it busy
BATCH = 4  # connections to look at, 60 us, before the loop may have the interpreter's lock
ADDRESSES = 4096


class _Watched:
    """A connection.

    since    when it began, by time.monotonic().
    charged  octets of it, without heartbeats, that its address was charged with.
    """

    __slots__ = ("charged", "connection", "since")

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.since = time.monotonic()
        self.charged = 0.0


class FloodWatch:
    """Waits in epoll for octets from subscribers, which seldom send; ends whoever sends more than its address may.

    A subscription costs the loop's thread more time than libzmq's own thread needs to read it. So libzmq, once it is
    called, takes subscriptions for as long as they come: 12 s and 2 GB were seen. Only another thread can end that. It
    shares descriptors with the loop, and a queue from which the loop takes what it has cut.

    on_end  is called in the loop with each connection that was ended.
    """

    def __init__(self, loop: Loop, on_end: Callable[[Connection], None]) -> None:
        self._loop = loop
        self._on_end = on_end
        self._ended: deque[Connection] = deque()
        self._tell = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._epoll = select.epoll()
        self._stop = os.eventfd(0, os.EFD_CLOEXEC)
        self._epoll.register(self._stop, select.EPOLLIN)
        self._watched: dict[int, _Watched] = {}
        self._levels: dict[str, tuple[float, float]] = {}  # octets left, and when
        self._thread: Thread | None = None
        loop.add(self)

    def fileno(self) -> int:
        return self._tell

    def ready(self, events: int) -> None:
        """Take what the thread has ended."""
        os.eventfd_read(self._tell)
        while self._ended:
            self._on_end(self._ended.popleft())

    def watch(self, connection: Connection) -> None:
        """Begin with a connection; the thread starts with the first one."""
        if not connection.is_counted:
            return
        descriptor = connection.fileno()
        self._watched[descriptor] = _Watched(connection)
        with suppress(OSError):
            self._epoll.register(descriptor, OCTETS_CAME)
        if self._thread is None:
            self._thread = Thread(target=self._run, name="flood-watch", daemon=True)
            self._thread.start()

    def forget(self, connection: Connection) -> None:
        """Before its descriptor is closed."""
        descriptor = connection.fileno()
        if self._watched.pop(descriptor, None) is not None and not self._epoll.closed:
            with suppress(OSError):
                self._epoll.unregister(descriptor)

    def close(self) -> None:
        """End the thread. Idempotent."""
        if self._epoll.closed:
            return
        if self._thread is not None:
            os.eventfd_write(self._stop, 1)
            self._thread.join()
        self._loop.remove(self)
        self._epoll.close()
        os.close(self._stop)
        os.close(self._tell)

    def _run(self) -> None:
        while True:
            events = self._epoll.poll(None, BATCH)
            for descriptor, _ in events:
                if descriptor == self._stop:
                    return
                watched = self._watched.get(descriptor)
                if watched is not None and not watched.connection.is_cut:
                    self._look(watched)
            if len(events) < BATCH:
                time.sleep(PAUSE_S)

    def _look(self, watched: _Watched) -> None:
        connection = watched.connection
        now = time.monotonic()
        received = connection.received() - HEARTBEATS * (now - watched.since)
        sent = max(0.0, received - watched.charged)
        watched.charged += sent
        left, when = self._levels.get(connection.address, (float(BURST), now))
        left = min(float(BURST), left + (now - when) * REFILL) - sent
        if len(self._levels) >= ADDRESSES:
            self._levels.clear()
        self._levels[connection.address] = max(left, -float(BURST)), now
        if left < 0 and received > SMALL:
            connection.cut()
            self._ended.append(connection)
            os.eventfd_write(self._tell, 1)
