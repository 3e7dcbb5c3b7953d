"""Sender of datagrams to all peers; decides what a full socket, an absent peer or a lost device causes."""

import errno
import socket
from collections.abc import Callable, Sequence
from typing import NamedTuple

from board.runtime.address import Address
from board.runtime.errors import RequestError
from board.runtime.loop import WRITE, Timer
from drivers.contract import BUSY, LATER, NOW, Host, Sent
from drivers.message import Request
from drivers.packet.access_category import BEACON, NEW_SOCKET, prioritize_datagrams
from drivers.packet.intake import refused
from drivers.reason import Reason

# Errors of an earlier datagram, reported by the next send(): an ICMP message said that no program listens, or that the
# host is unreachable. The datagram of the send() that reports such an error did not leave.
ABSENT = frozenset({errno.ECONNREFUSED, errno.EHOSTUNREACH})
# Errors of a full device queue. The kernel reports no event when the queue has room again, so the sender tries again
# after NO_ROOM_S.
NO_ROOM = frozenset({errno.ENOBUFS, errno.ENOMEM})
NO_ROOM_S = 0.005


class Target:
    """A socket connected to one peer or group; the loop watches it only while it is full."""

    def __init__(self, to: Address, sender: socket.socket) -> None:
        self.to = to
        self.socket = sender
        self.sender: Sender | None = None  # sender to resume when the socket has room again

    def fileno(self) -> int:
        return self.socket.fileno()

    def ready(self, events: int) -> None:
        if self.sender is not None:
            self.sender.resume()


class Rest(NamedTuple):
    """A datagram that was sent to some targets only.

    number   index of the first target that it must still be sent to.
    request  request of the datagram; None for a beacon.
    """

    octets: bytes
    number: int
    request: Request | None


class Sender:
    """Sends each datagram to every target. It owns the sockets: close() closes them.

    absent  called with the address of a target where no program listens; the sender still sends to it.
    """

    def __init__(self, host: Host, targets: Sequence[Target], absent: Callable[[Address], None]) -> None:
        self._host = host
        self._targets = targets
        self._sends = [target.socket.send for target in targets]
        self._absent = absent
        self._traffic_class = NEW_SOCKET
        self._is_full = False
        self._full: Target | None = None
        self._rest: Rest | None = None
        self._timer: Timer | None = None
        for target in targets:
            target.sender = self

    def send(self, octets: bytes, request: Request | None = None) -> Sent:
        """Send a datagram to all targets.

        request  request of the datagram; None for a beacon.

        Returns NOW if all targets took it, BUSY if none did, LATER if only some did: a confirm then follows. Raises
        RequestError if it is too long for a datagram.
        """
        if self._is_full:
            return BUSY
        traffic_class = BEACON if request is None else request.traffic_class
        if traffic_class != self._traffic_class:
            self._prioritize(traffic_class)
        for send in self._sends:
            try:
                send(octets)
            except OSError as error:
                return self._go_on(Rest(octets, self._sends.index(send), request), error)
        return NOW

    def close(self) -> None:
        """Close all sockets; idempotent. A datagram not yet sent to all targets is discarded."""
        self._leave_loop()
        for target in self._targets:
            target.socket.close()

    def _prioritize(self, traffic_class: int) -> None:
        self._traffic_class = traffic_class
        for target in self._targets:
            prioritize_datagrams(target.socket, traffic_class)

    def _go_on(self, rest: Rest, error: OSError | None = None) -> Sent:
        """Send the datagram to the remaining targets; error is what the first of them has just reported."""
        for number in range(rest.number, len(self._sends)):
            error = self._reach(number, rest.octets, error)
            if error is not None:
                return self._stop_at(error, rest._replace(number=number))
        return NOW

    def _reach(self, number: int, octets: bytes, error: OSError | None) -> OSError | None:
        """Send to one target; return the error that stops this datagram, or None.

        number  index of the target.
        error   error that the target has just reported, if any.

        A target where no program listens is reported to `absent` and stops nothing: it loses this datagram, as UDP
        permits.
        """
        # At most two errors of earlier datagrams can wait in the socket.
        for _ in range(2):
            if error is not None and error.errno not in ABSENT:
                return error
            try:
                self._sends[number](octets)
                break
            except OSError as again:
                error = again
        if error is not None:
            if error.errno not in ABSENT:
                return error
            self._absent(self._targets[number].to)
        return None

    def _stop_at(self, error: OSError, rest: Rest) -> Sent:
        target = self._targets[rest.number]
        if error.errno == errno.EAGAIN:
            self._full = target
            self._host.loop.add(target, WRITE)
        elif error.errno in NO_ROOM:
            self._timer = self._host.loop.after(NO_ROOM_S, self.resume)
        elif error.errno == errno.EMSGSIZE:
            raise RequestError(f"{len(rest.octets)} octets are too long for a datagram to {target.to}")
        else:
            self._host.fail(refused(f"sending to {target.to}", error))
            return BUSY
        self._is_full = True
        self._rest = rest if rest.number > 0 else None
        return LATER if self._rest else BUSY

    def resume(self) -> None:
        self._leave_loop()
        self._is_full = False
        rest, self._rest = self._rest, None
        if rest is not None and not self._has_gone(rest):
            return
        self._host.writable()

    def _has_gone(self, rest: Rest) -> bool:
        """Send the datagram to the remaining targets; return True if that ended, by sending or by a drop."""
        reason = None
        try:
            if self._go_on(rest) is not NOW:
                return False
        except RequestError:
            reason = Reason.LONG_PDU
        if rest.request is not None:
            self._host.confirm(rest.request, reason)
        return True

    def _leave_loop(self) -> None:
        if self._full is not None:
            self._host.loop.remove(self._full)
            self._full = None
        if self._timer is not None:
            self._timer.cancel()
