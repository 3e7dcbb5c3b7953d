"""Datagrams to peers: what a full socket, an absent peer and a lost device mean."""

import errno
import socket
from collections.abc import Callable, Sequence
from typing import NamedTuple

from board.errors import RequestError
from board.loop import WRITE, Timer
from drivers.contract import Host, Sent
from drivers.intake import refused
from drivers.message import Request
from drivers.udp_socket import Address

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
        self._is_full = False
        self._full: Target | None = None
        self._rest: Rest | None = None
        self._timer: Timer | None = None
        for target in targets:
            target.has_room = self._resume

    def send(self, octets: bytes, request: Request | None = None) -> Sent:
        """Send to all targets: NOW; BUSY when none took it; LATER when only some did, with a confirm at the end."""
        if self._is_full:
            return Sent.BUSY
        for send in self._sends:
            try:
                send(octets)
            except OSError as error:
                return self._go_on(error, Rest(octets, self._sends.index(send), request))
        return Sent.NOW

    def close(self) -> None:
        """Close all sockets; idempotent. A datagram that some targets have not got is dropped."""
        self._leave_loop()
        for target in self._targets:
            target.socket.close()

    def _go_on(self, error: OSError | None, rest: Rest) -> Sent:
        """Send the rest after one target's socket reported an error."""
        octets, place, request = rest
        while True:
            if error is None:
                place += 1
            elif error.errno in ABSENT:
                self._absent(self._targets[place].to)
            else:
                return self._stop_at(error, Rest(octets, place, request))
            if place == len(self._sends):
                return Sent.NOW
            error = self._try(place, octets)

    def _try(self, place: int, octets: bytes) -> OSError | None:
        # An absent peer's error is told once for each datagram that met it: two may be waiting, more cannot.
        for _ in range(2):
            try:
                self._sends[place](octets)
            except OSError as error:
                if error.errno not in ABSENT:
                    return error
            else:
                return None
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
            return Sent.BUSY
        self._is_full = True
        self._rest = rest if rest.place > 0 else None
        return Sent.LATER if self._rest else Sent.BUSY

    def _resume(self) -> None:
        self._leave_loop()
        self._is_full = False
        rest, self._rest = self._rest, None
        if rest is not None:
            outcome = self._go_on(self._try(rest.place, rest.octets), rest)
            if outcome is not Sent.NOW:
                return
            if rest.request is not None:
                self._host.confirm(rest.request)
        self._host.writable()

    def _leave_loop(self) -> None:
        if self._full is not None:
            self._host.loop.remove(self._full)
            self._full = None
        if self._timer is not None:
            self._timer.cancel()
