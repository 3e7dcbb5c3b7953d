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
UNIX, UNKNOWN = "unix", "unknown"
LOCAL = ("127.", "::1", "::ffff:127.")
_numbers = itertools.count()


class Connection:
    """A connection that a socket of libzmq has accepted.

    descriptor  libzmq's own, by which its messages name it. Another connection may get the number later.
    endpoint    that it was accepted at, in libzmq's words.
    address     of the peer without its port; UNIX or UNKNOWN where there is none.
    topics      that it is subscribed to.
    is_used     whether a message of it was ever delivered.
    mark        octets that libzmq had read when a message of it was delivered last.
    blocked_at  messages published when it took nothing any more; None while it takes octets.
    """

    def __init__(self, descriptor: int, endpoint: str, name: str) -> None:
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
        self.address, self.port, self.peer = UNKNOWN, 0, "a connection that has ended"
        self._socket = _second(descriptor, endpoint)
        if self._socket is not None:
            self._name(self._socket)

    @property
    def is_unix(self) -> bool:
        return self.address == UNIX

    @property
    def is_counted(self) -> bool:
        """Whether the kernel counts what comes by it: not of a Unix socket."""
        return self._socket is not None and not self.is_unix

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

    def _name(self, own: socket.socket) -> None:
        if own.family == socket.AF_UNIX:
            self.address, self.peer = UNIX, "a Unix socket"
            return
        with suppress(OSError):  # the peer has just left: its end is told next
            self.address, self.port = own.getpeername()[:2]
            self.peer = f"{self.address} port {self.port}"


def _second(descriptor: int, endpoint: str) -> socket.socket | None:
    """Return a second descriptor of a connection that was accepted at an endpoint.

    None where the connection has ended already, and its number may belong to a file or to another socket, and where
    no descriptor is left.
    """
    try:
        second = os.dup(descriptor)
    except OSError:
        return None
    try:
        own = socket.socket(fileno=second)
    except OSError:  # a file
        os.close(second)
        return None
    with suppress(OSError):  # not connected: a listener, or a connection that was reset
        if own.type == socket.SOCK_STREAM and _is_accepted_at(own, endpoint):
            return own
    own.close()
    return None


def _is_accepted_at(own: socket.socket, endpoint: str) -> bool:
    """Whether a connection came to an endpoint. Of TCP the port tells: where any address is bound, all have it."""
    own.getpeername()  # raises where there is no peer
    bound = own.getsockname()
    if own.family == socket.AF_UNIX:
        name = os.fsdecode(bound)
        return endpoint == "ipc://" + ("@" + name[1:] if name.startswith("\0") else name)
    return own.family in (socket.AF_INET, socket.AF_INET6) and endpoint.endswith(f":{bound[1]}")
