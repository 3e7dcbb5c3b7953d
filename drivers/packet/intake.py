"""Reception from sockets in batches: kernel time stamps, kernel drops, urgent lane first."""

import socket
import struct
from collections.abc import Callable
from typing import Final

from board.runtime.errors import InterfaceError
from drivers.contract import Host
from drivers.packet.datagrams import OUTCOME, TIMESPEC, Room
from drivers.reason import Reason

# Numbers of asm-generic/socket.h and linux/sock_diag.h that the socket module does not name.
SO_RCVBUFFORCE = 33
SO_TIMESTAMPNS = 35
SO_MEMINFO = 55
SK_MEMINFO_DROPS = 8  # index of sk_drops, the socket's drop counter, in the answer to SO_MEMINFO

MSG_TRUNC: Final = int(socket.MSG_TRUNC)  # an int, because & with the enum takes a microsecond

# After BATCH datagrams a flooded lane lets the loop's other sources run. Whenever the other lanes together have taken
# SLICE datagrams, the urgent lane is read again. An urgent message waits for two slices at most, about 0.2 ms.
BATCH = 32
SLICE = 8

# The remedy does not name setcap: the one-file binary would refuse to start with it, and a script would not get the
# right (tests/system/test_rights.py).
RAW_SOCKETS = (
    "run it as root, or with CAP_NET_RAW: AmbientCapabilities=CAP_NET_RAW of its service, or "
    "setpriv --inh-caps=+net_raw --ambient-caps=+net_raw"
)

Deliver = Callable[[bytes, int], None]


class Intake:
    """Reads a socket's datagrams in batches, and passes each with its kernel time stamp to one function.

    taken    the socket. The intake owns it: close() closes it.
    deliver  called with each datagram and its time of arrival: Unix time in nanoseconds.
    broken   called with an error that the socket reports.
    urgent   intake of the urgent lane, which is read before this one; None if this is the urgent lane.
    own      address of this interface's sending socket, in the form of sockaddr(). The kernel also delivers own
             datagrams to a group; they are skipped and not counted. Empty: all datagrams are passed on.
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
        self._passed = 0  # datagrams that other lanes have taken since this lane, the urgent one, was last read
        # All lanes of an interface share one buffer, because deliver() never reads another lane.
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
        """Count datagrams that another lane has taken; read this urgent lane if they are SLICE or more."""
        self._passed += taken
        if self._passed >= SLICE:
            self._passed = 0
            for _ in range(BATCH // SLICE):
                if self._take() < SLICE:
                    return

    def _take(self) -> int:
        """Read one slice of datagrams; return their number, which is less than SLICE if the socket is empty."""
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
            if not self._is_open:  # deliver() led to the stop of the interface
                return 0
        return count

    def close(self) -> None:
        """Leave the loop and close the socket; idempotent."""
        if self._is_open:
            self._is_open = False
            self._host.loop.remove(self)
            self.socket.close()


class KernelDrops:
    """Count of datagrams that the kernel dropped because the receive queue of a UDP socket was full.

    SO_MEMINFO returns the counter sk_drops at any time. SO_RXQ_OVFL gives the same counter, but only with a later
    datagram, so drops at the end of a flood would stay unknown. The counter includes datagrams that a filter on the
    socket rejects. Therefore sockets that are counted this way have no filter.
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
    """Enlarge the receive buffer of a socket; return a note for the user if the kernel gives less, else "".

    The kernel's default of 208 KiB holds 166 small datagrams, because the kernel counts about 1.3 KiB for each.
    """
    try:
        receiver.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, octets)
    except PermissionError:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, octets)
    # The kernel doubles the requested size for its own overhead, and reports the doubled size.
    given = receiver.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 2
    if given >= octets:
        return ""
    return f"receive buffer of {given} instead of {octets} octets: raise net.core.rmem_max"


def refused(what: str, error: OSError, hint: str = "") -> InterfaceError:
    """Return the InterfaceError of a failed system call; `what` names its operation or device, `hint` the remedy."""
    return InterfaceError(f"{what}: {(error.strerror or str(error)).lower()}", hint)


def not_permitted(device: str) -> InterfaceError:
    """Return the InterfaceError for a user who has no permission to open raw sockets."""
    return InterfaceError(f"{device}: raw sockets are not permitted", RAW_SOCKETS)
