"""Datagrams to peers: what a full socket, an absent peer and a lost device mean."""

import errno
import socket
from collections.abc import Callable, Sequence
from typing import NamedTuple

from board.address import Address
from board.errors import RequestError
from board.loop import WRITE, Timer
from drivers.access_category import BEACON, NEW_SOCKET, prioritize_datagrams
from drivers.contract import BUSY, LATER, NOW, Host, Sent
from drivers.intake import refused
from drivers.message import Request
from drivers.reason import Reason

# What an earlier datagram met, told at the next send(): ICMP says that nobody is there. The datagram of this
# send() did not leave.
ABSENT = frozenset({errno.ECONNREFUSED, errno.EHOSTUNREACH})
# The device's queue is full, and no event tells when there is room again: ask after this time.
NO_ROOM = frozenset({errno.ENOBUFS, errno.ENOMEM})
NO_ROOM_S = 0.005


class Target:
    """A connected socket to one peer or group; on the loop only while it is full."""

    def __init__(self, to: Address, sender: socket.socket) -> None:
        self.to = to
        self.socket = sender
        self.has_room: Callable[[], None] = lambda: None

    def fileno(self) -> int:
        return self.socket.fileno()

    def ready(self, events: int) -> None:
        self.has_room()


class Rest(NamedTuple):
    """A datagram that the targets from place on have not got yet."""

    octets: bytes
    place: int
    request: Request | None


class Sender:
    """Sends each datagram to every target; the sockets are its own, close() closes them.

    absent  is told of a target where nobody listens; sending to it goes on.
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
            target.has_room = self._resume

    def send(self, octets: bytes, request: Request | None = None) -> Sent:
        """Send to all targets: NOW; BUSY when none took it; LATER when only some did, with a confirm at the end.

        Without a request it is a beacon. Raises RequestError when it is too long for a datagram.
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
        """Close all sockets; idempotent. A datagram that some targets have not got is dropped."""
        self._leave_loop()
        for target in self._targets:
            target.socket.close()

    def _prioritize(self, traffic_class: int) -> None:
        self._traffic_class = traffic_class
        for target in self._targets:
            prioritize_datagrams(target.socket, traffic_class)

    def _go_on(self, rest: Rest, error: OSError | None = None) -> Sent:
        """Send the rest; error is what the first of its targets has just reported."""
        for place in range(rest.place, len(self._sends)):
            error = self._reach(place, rest.octets, error)
            if error is not None:
                return self._stop_at(error, rest._replace(place=place))
        return NOW

    def _reach(self, place: int, octets: bytes, error: OSError | None) -> OSError | None:
        """Send to one target, after its error if there is one; returns what stops this datagram.

        Nobody there is told, and stops nothing: this datagram is lost to that peer, as any is in UDP.
        """
        # Errors of earlier datagrams wait in the socket: two may, more cannot.
        for _ in range(2):
            if error is not None and error.errno not in ABSENT:
                return error
            try:
                self._sends[place](octets)
                break
            except OSError as again:
                error = again
        if error is not None:
            if error.errno not in ABSENT:
                return error
            self._absent(self._targets[place].to)
        return None

    def _stop_at(self, error: OSError, rest: Rest) -> Sent:
        target = self._targets[rest.place]
        if error.errno == errno.EAGAIN:
            self._full = target
            self._host.loop.add(target, WRITE)
        elif error.errno in NO_ROOM:
            self._timer = self._host.loop.after(NO_ROOM_S, self._resume)
        elif error.errno == errno.EMSGSIZE:
            raise RequestError(f"{len(rest.octets)} octets are too long for a datagram to {target.to}")
        else:
            self._host.fail(refused(f"sending to {target.to}", error))
            return BUSY
        self._is_full = True
        self._rest = rest if rest.place > 0 else None
        return LATER if self._rest else BUSY

    def _resume(self) -> None:
        self._leave_loop()
        self._is_full = False
        rest, self._rest = self._rest, None
        if rest is not None and not self._has_gone(rest):
            return
        self._host.writable()

    def _has_gone(self, rest: Rest) -> bool:
        """Send the rest; whether it is done with, sent or dropped."""
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
