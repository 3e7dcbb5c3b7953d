"""One connection of a peer, by a second descriptor of its socket: who it is, what it has sent, its end."""

import fcntl
import itertools
import os
import select
import socket
import struct
from contextlib import suppress

TCP_INFO_OCTETS = 136
SIOCINQ = 0x541B  # octets that wait to be read: tcp(7)
WAITING = struct.Struct("=i")
RECEIVED = struct.Struct("=Q")
RECEIVED_AT = 128  # tcpi_bytes_received of struct tcp_info, linux/tcp.h; since Linux 4.1
# Of epoll: once each time that octets come. A look at EPOLLIN alone would not see what libzmq has read already; nearly
# always a socket takes octets, too, and then that is seen.
OCTETS_CAME = select.EPOLLIN | select.EPOLLOUT | select.EPOLLET
RESET = struct.pack("=ii", 1, 0)  # struct linger: closing drops what is not sent
LOCAL = ("127.", "::1", "::ffff:127.")
_numbers = itertools.count()


class Connection:
    """A connection that a socket of libzmq has accepted.

    descriptor  libzmq's own, by which its messages name it. Another connection may get the number later.
    address     of the peer without its port; empty for a Unix socket.
    topics      that it is subscribed to.
    is_used     whether a message of it was ever delivered.
    mark        octets that libzmq had read when a message of it was delivered last.
    blocked_at  messages published when it took nothing any more; None while it takes octets.
    """

    def __init__(self, descriptor: int, name: str) -> None:
        self.descriptor = descriptor
        self.name = name
        self.topics: set[bytes] = set()
        self.is_used = False
        self.is_cut = False
        self.number = next(_numbers)
        self.mark = self.looked_at = 0.0
        self.blocked_at: int | None = None
        self.writable_looks = 0
        self.sent_at_cut = 0
        self.address, self.port, self.peer = "", 0, "a Unix socket"
        self._socket: socket.socket | None = None
        try:
            self._socket = socket.socket(fileno=os.dup(descriptor))
            if self._socket.family != socket.AF_UNIX:
                self.address, self.port = self._socket.getpeername()[:2]
                self.peer = f"{self.address} port {self.port}"
        except OSError:  # it has gone already: its end is told next; or there are no descriptors left
            self.peer = "a connection that has ended"

    @property
    def is_unix(self) -> bool:
        """Whether files' rights decide who connects."""
        return not self.address

    @property
    def is_local(self) -> bool:
        return self.is_unix or self.address.startswith(LOCAL)

    def received(self) -> int:
        """Octets that have come from the peer; 0 where nobody knows."""
        own = self._socket  # another thread may ask
        if own is None or self.is_unix:
            return 0
        try:
            told = own.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, TCP_INFO_OCTETS)
        except OSError:
            return 0
        return int(RECEIVED.unpack_from(told, RECEIVED_AT)[0]) if len(told) >= TCP_INFO_OCTETS else 0

    def read(self) -> int:
        """Octets that libzmq has read: what waits in the kernel may be whole messages, and is limited there."""
        own = self._socket
        if own is None or self.is_unix:
            return 0
        try:
            waiting = WAITING.unpack(fcntl.ioctl(own, SIOCINQ, bytes(WAITING.size)))[0]  # first: it gets less
        except OSError:
            return 0
        return max(0, self.received() - int(waiting))

    def fileno(self) -> int:
        """The second descriptor; -1 when it is closed."""
        return -1 if self._socket is None else self._socket.fileno()

    def cut(self) -> None:
        """End it for both sides. libzmq finds it ended and takes it apart."""
        self.is_cut = True
        self.sent_at_cut = self.received()
        if self._socket is not None:
            with suppress(OSError):  # the peer was first
                # What waits for a peer that does not read would keep the kernel's memory for minutes.
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
                self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Give the second descriptor back. Idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
