"""What arrives at a socket, in batches: kernel time stamps, kernel drops, the urgent lane first."""

import socket
import struct
from collections.abc import Callable
from typing import Final

from board.errors import InterfaceError
from drivers.contract import Host
from drivers.reason import Reason

# Numbers of asm-generic/socket.h and linux/sock_diag.h that the socket module does not name.
SO_RCVBUFFORCE = 33
SO_TIMESTAMPNS = 35
SO_MEMINFO = 55
SK_MEMINFO_DROPS = 8  # the index of sk_drops

MAX_DATAGRAM = 2048  # octets: the longest PDU, its headers and an 802.11p frame fit
MSG_TRUNC: Final = int(socket.MSG_TRUNC)  # an enum's & takes a microsecond
TIMESPEC: Final = struct.Struct("@ll")
STAMP_SPACE = socket.CMSG_SPACE(TIMESPEC.size)

# A flooded lane gives way to the loop's other sources after BATCH datagrams. The urgent lane is looked at again
# whenever the others together have taken SLICE: an urgent message waits for two slices at most, 0.2 ms or so.
BATCH = 32
SLICE = 8

Deliver = Callable[[bytes, int], None]


class Intake:
    """A socket on the loop whose datagrams go to one call, each with the Unix time in ns of its arrival.

    The intake owns the socket: close() closes it. A datagram from `own` (the address of a sender of ours) is an
    echo. `broken` is called with what the socket reports beside datagrams. `urgent` is the lane that goes first.
    """

    def __init__(
        self,
        host: Host,
        taken: socket.socket,
        deliver: Deliver,
        broken: Callable[[OSError], None],
        urgent: "Intake | None" = None,
    ) -> None:
        self.socket = taken
        self.own: object = None
        self._host = host
        self._deliver = deliver
        self._broken = broken
        self._urgent = urgent or self
        self._passed = 0  # taken by other lanes since this one, the urgent one, was looked at
        self._is_open = True
        taken.setblocking(False)
        taken.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        host.loop.add(self)

    def fileno(self) -> int:
        return self.socket.fileno()

    def ready(self, events: int) -> None:
        urgent = self._urgent
        for _ in range(BATCH // SLICE):
            taken = self._take(SLICE)
            if urgent is not self:
                urgent.give_way(taken)
            if taken < SLICE:
                return

    def give_way(self, taken: int) -> None:
        """Another lane has taken so many: this one is looked at before they are too many."""
        self._passed += taken
        if self._passed >= SLICE:
            self._passed = 0
            self._take(BATCH)

    def _take(self, limit: int) -> int:
        """Take at most limit datagrams; returns how many, fewer when there are no more."""
        receive, deliver, unpack, own = self.socket.recvmsg, self._deliver, TIMESPEC.unpack, self.own
        for taken in range(limit):
            try:
                octets, ancillary, flags, address = receive(MAX_DATAGRAM, STAMP_SPACE)
            except BlockingIOError:
                return taken
            except OSError as error:
                if self._is_open:  # what deliver() caused may have stopped the interface, and closed the socket
                    self._broken(error)
                return taken
            if flags:
                self._host.drop(Reason.LONG_PDU, octets)
            elif address == own:
                self._host.drop(Reason.OWN_ECHO, octets)
            else:
                seconds, nanoseconds = unpack(ancillary[0][2])
                deliver(octets, seconds * 1_000_000_000 + nanoseconds)
        return limit

    def close(self) -> None:
        """Leave the loop and close the socket; idempotent."""
        if self._is_open:
            self._is_open = False
            self._host.loop.remove(self)
            self.socket.close()


class KernelDrops:
    """How many datagrams the kernel refused a UDP socket since the last look: its queue was full.

    sk_drops by SO_MEMINFO can be asked for at any time. SO_RXQ_OVFL tells the same counter, but only beside a later
    datagram, so the drops at the end of a flood would stay unknown. The counter includes what a filter on the socket
    rejects: none is attached to a socket that is counted so.
    """

    def __init__(self, counted: socket.socket) -> None:
        self._socket = counted
        self._before = 0

    def take(self) -> int:
        meminfo = self._socket.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, 64)
        drops = int(struct.unpack_from("=I", meminfo, 4 * SK_MEMINFO_DROPS)[0])
        new = (drops - self._before) & 0xFFFFFFFF
        self._before = drops
        return new


def enlarge(receiver: socket.socket, octets: int) -> str:
    """Ask for a receive buffer; returns what to tell the user where the kernel gives less, else an empty text.

    The default of 208 KiB keeps 166 small datagrams: the kernel counts about 1.3 KiB for each.
    """
    try:
        receiver.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, octets)
    except PermissionError:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, octets)
    # The kernel doubles the number for its own overhead, and reports the double.
    given = receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2
    if given >= octets:
        return ""
    return f"receive buffer of {given} instead of {octets} octets: raise net.core.rmem_max"


def refused(what: str, error: OSError, hint: str = "") -> InterfaceError:
    """The InterfaceError of a system call's failure."""
    return InterfaceError(f"{what}: {(error.strerror or str(error)).lower()}", hint)
