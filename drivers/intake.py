"""What arrives at a socket, in batches: kernel time stamps, kernel drops, the urgent lane first."""

import socket
import struct
from collections.abc import Callable
from typing import Final

from board.errors import InterfaceError
from drivers.contract import Host
from drivers.datagrams import OUTCOME, TIMESPEC, Room
from drivers.reason import Reason

# Numbers of asm-generic/socket.h and linux/sock_diag.h that the socket module does not name.
SO_RCVBUFFORCE = 33
SO_TIMESTAMPNS = 35
SO_MEMINFO = 55
SK_MEMINFO_DROPS = 8  # the index of sk_drops

MSG_TRUNC: Final = int(socket.MSG_TRUNC)  # an enum's & takes a microsecond

# A flooded lane gives way to the loop's other sources after BATCH datagrams. The urgent lane is looked at again
# whenever the others together have taken SLICE: an urgent message waits for two slices at most, 0.2 ms or so.
BATCH = 32
SLICE = 8

# Not setcap: with it the one-file binary refuses to start, and a script gets nothing (tests/system/test_rights.py).
RAW_SOCKETS = (
    "run it as root, or with CAP_NET_RAW: AmbientCapabilities=CAP_NET_RAW of its service, or "
    "setpriv --inh-caps=+net_raw --ambient-caps=+net_raw"
)

Deliver = Callable[[bytes, int], None]


class Intake:
    """A socket on the loop whose datagrams go to one call, each with the Unix time in ns of its arrival.

    The intake owns the socket: close() closes it. A datagram from `own` (a sender of ours, as sockaddr() has it) is the
    kernel's copy of what was sent to a group: passed over, and not counted. `broken` is called with what the socket
    reports beside datagrams. `urgent` is the lane that goes first.
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
        self.own = b""
        self._host = host
        self._deliver = deliver
        self._broken = broken
        self._urgent = urgent or self
        self._passed = 0  # taken by other lanes since this one, the urgent one, was looked at
        # One room for all lanes of an interface: nothing that deliver() calls takes from another of them.
        self._room: Room = urgent._room if urgent else Room(SLICE)
        self._is_open = True
        taken.setblocking(False)
        taken.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        host.loop.add(self)

    def fileno(self) -> int:
        return self.socket.fileno()

    def ready(self, events: int) -> None:
        urgent = self._urgent
        for _ in range(BATCH // SLICE):
            taken = self._take()
            if urgent is not self:
                urgent.give_way(taken)
            if taken < SLICE:
                return

    def give_way(self, taken: int) -> None:
        """Another lane has taken so many: this one is looked at before they are too many."""
        self._passed += taken
        if self._passed >= SLICE:
            self._passed = 0
            for _ in range(BATCH // SLICE):
                if self._take() < SLICE:
                    return

    def _take(self) -> int:
        """Take a slice; returns how many datagrams it had, fewer than SLICE when there are no more."""
        if not self._is_open:
            return 0
        room, deliver, own = self._room, self._deliver, self.own
        try:
            count = room.receive(self.socket.fileno())
        except OSError as error:
            self._broken(error)
            return 0
        memory, headers, outcome, timespec = room.memory, room.headers, OUTCOME.unpack_from, TIMESPEC.unpack_from
        for octets_at, stamp_at, name_at, outcome_at in room.places[:count]:
            flags, length = outcome(headers, outcome_at)
            octets = memory[octets_at : octets_at + length]
            if flags & MSG_TRUNC:
                self._host.drop(Reason.LONG_PDU, octets)
            elif not own or memory[name_at : name_at + len(own)] != own:
                seconds, nanoseconds = timespec(memory, stamp_at)
                deliver(octets, seconds * 1_000_000_000 + nanoseconds)
            if not self._is_open:  # what deliver() caused has stopped the interface
                return 0
        return count

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


def not_permitted(device: str) -> InterfaceError:
    """That of a raw socket for a user without the right to one."""
    return InterfaceError(f"{device}: raw sockets are not permitted", RAW_SOCKETS)
