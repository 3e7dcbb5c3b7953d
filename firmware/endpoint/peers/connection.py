"""Connection of a peer: inspected and ended by a duplicate descriptor."""

import fcntl
import itertools
import os
import select
import socket
import struct
from contextlib import suppress

TCP_INFO_OCTETS = 136
SIOCINQ = 0x541B  # ioctl that returns the number of octets in the receive queue: tcp(7)
WAITING = struct.Struct("=i")
RECEIVED = struct.Struct("=Q")
RECEIVED_AT = 128  # tcpi_bytes_received of struct tcp_info, linux/tcp.h; since Linux 4.1
# Flags for epoll: one event for each arrival of octets. EPOLLIN alone would miss octets that libzmq has already read.
# With EPOLLOUT the event is reported anyway, because the socket is nearly always writable.
OCTETS_CAME = select.EPOLLIN | select.EPOLLOUT | select.EPOLLET
RESET = struct.pack("=ii", 1, 0)  # struct linger with timeout 0: close() discards unsent octets
UNIX, UNKNOWN = "unix", "unknown"
LOCAL = ("127.", "::1", "::ffff:127.")
_numbers = itertools.count()


class Connection:
    """A connection that a socket of libzmq has accepted.

    descriptor  descriptor that libzmq uses and attaches to messages. A later connection may get the same number.
    endpoint    address at which the station accepted it, in libzmq's notation.
    address     address of the peer, without port; UNIX for a Unix socket, UNKNOWN if it has already ended.
    topics      topics to which the peer is subscribed.
    is_used     True once a message of the peer was delivered.
    is_cut      True once the station has ended the connection.
    mark        number of octets that libzmq had read when the last message was delivered.
    blocked_at  number of published messages when the socket stopped accepting octets; None while it accepts them.
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
        """True if the kernel counts the received octets: for TCP, but not for a Unix socket."""
        return self._socket is not None and not self.is_unix

    @property
    def is_local(self) -> bool:
        return self.is_unix or self.address.startswith(LOCAL)

    def received(self) -> int:
        """Return the number of octets received from the peer; 0 if unknown."""
        own = self._socket  # a local copy, because another thread may call this during close()
        if own is None or self.is_unix:
            return 0
        try:
            told = own.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, TCP_INFO_OCTETS)
        except OSError:
            return 0
        return int(RECEIVED.unpack_from(told, RECEIVED_AT)[0]) if len(told) >= TCP_INFO_OCTETS else 0

    def read(self) -> int:
        """Return the number of octets that libzmq has read; 0 if unknown.

        Octets in the kernel's receive queue are not counted, because the kernel limits that queue.
        """
        own = self._socket
        if own is None or self.is_unix:
            return 0
        try:
            # The queue is read before the total: it shrinks meanwhile, so the difference is never too large.
            waiting = WAITING.unpack(fcntl.ioctl(own, SIOCINQ, bytes(WAITING.size)))[0]
        except OSError:
            return 0
        return max(0, self.received() - int(waiting))

    def fileno(self) -> int:
        """Return the duplicate descriptor; -1 when it is closed."""
        return -1 if self._socket is None else self._socket.fileno()

    def cut(self) -> None:
        """Shut the connection down in both directions. libzmq then finds it closed and frees it."""
        self.is_cut = True
        self.sent_at_cut = self.received()
        if self._socket is not None:
            with suppress(OSError):  # the peer may have closed the connection already
                # Without RESET, unsent octets for a peer that does not read would occupy kernel memory for minutes.
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
                self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        """Close the duplicate descriptor; a second call has no effect."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _name(self, own: socket.socket) -> None:
        if own.family == socket.AF_UNIX:
            self.address, self.peer = UNIX, "a Unix socket"
            return
        with suppress(OSError):  # the peer has just closed the connection: the monitor will report its end
            self.address, self.port = own.getpeername()[:2]
            self.peer = f"{self.address} port {self.port}"


def _second(descriptor: int, endpoint: str) -> socket.socket | None:
    """Return a socket with a duplicate descriptor of a connection that was accepted at an endpoint.

    Return None if no descriptor is free, or if the connection has ended. Its number may then belong to a file or to
    another socket.
    """
    try:
        second = os.dup(descriptor)
    except OSError:
        return None
    try:
        own = socket.socket(fileno=second)
    except OSError:  # the number belongs to a file
        os.close(second)
        return None
    with suppress(OSError):  # the socket is not connected: a listener, or a connection that was reset
        if own.type == socket.SOCK_STREAM and _is_accepted_at(own, endpoint):
            return own
    own.close()
    return None


def _is_accepted_at(own: socket.socket, endpoint: str) -> bool:
    """Return True if a connection was accepted at an endpoint. Raises OSError if the socket is not connected.

    For TCP only the port is compared, because the endpoint may be the wildcard address.
    """
    own.getpeername()  # raises OSError without a peer
    bound = own.getsockname()
    if own.family == socket.AF_UNIX:
        name = os.fsdecode(bound)
        return endpoint == "ipc://" + ("@" + name[1:] if name.startswith("\0") else name)
    return own.family in (socket.AF_INET, socket.AF_INET6) and endpoint.endswith(f":{bound[1]}")
