"""Flood watch: thread that ends connections of subscribers that flood the station.

While they send, libzmq keeps the loop's thread inside one call, so the loop itself cannot end them.
"""

import os
import select
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from threading import Thread

from board.runtime.loop import Loop
from firmware.endpoint.peers.connection import OCTETS_CAME, Connection
from firmware.endpoint.peers.limits import HEARTBEATS

# Octets, without heartbeats, that subscribers of one address may send at once, and per second. BURST has room for 512
# topics of 256 octets, which are 136 kB. Each such topic keeps the loop's thread inside libzmq for 80 us.
BURST, REFILL = 160 * 1024, 4 * 1024
# Octets. A connection that has sent no more than this (handshake and 30 topics) is not ended because of other
# connections of its address.
SMALL = 1024
PAUSE_S = 0.0005  # pause of the thread (not of the loop) after a check: without it, a flood would keep the thread busy
BATCH = 4  # number of connections per check (60 us); after a check, the loop may take the interpreter's lock
ADDRESSES = 4096


class _Watched:
    """Connection under watch.

    since    start of the watch, by time.monotonic().
    charged  octets of this connection, without heartbeats, that were counted for its address.
    """

    __slots__ = ("charged", "connection", "since")

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.since = time.monotonic()
        self.charged = 0.0


class FloodWatch:
    """Thread that waits in epoll for octets of subscribers and ends connections above the limit of their address.

    Subscribers usually send little. A subscription costs the loop's thread more time than libzmq's own thread needs to
    read it. In a flood, a single call of libzmq therefore processes subscriptions as long as they arrive: 12 s and 2 GB
    were seen. Only another thread can end that. This thread shares descriptors with the loop, and a queue of ended
    connections.

    on_end  called in the loop's thread with each connection that was ended.
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
        # Token bucket of each address: octets that it may still send, and the time at which this was computed.
        self._levels: dict[str, tuple[float, float]] = {}
        self._thread: Thread | None = None
        loop.add(self)

    def fileno(self) -> int:
        return self._tell

    def ready(self, events: int) -> None:
        """Call on_end with each connection that the thread has ended."""
        os.eventfd_read(self._tell)
        while self._ended:
            self._on_end(self._ended.popleft())

    def watch(self, connection: Connection) -> None:
        """Watch a connection if the kernel counts its octets. The first one starts the thread."""
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
        """Stop watching a connection; call this before its descriptor is closed."""
        descriptor = connection.fileno()
        if self._watched.pop(descriptor, None) is not None and not self._epoll.closed:
            with suppress(OSError):
                self._epoll.unregister(descriptor)

    def close(self) -> None:
        """End the thread; a second call has no effect."""
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
