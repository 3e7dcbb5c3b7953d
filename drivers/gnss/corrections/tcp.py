"""Corrections from a TCP server that sends RTCM to each client without a request."""

import errno
import os
import socket
from collections.abc import Callable

from board.runtime.address import Address
from board.runtime.loop import READ, WRITE
from drivers.contract import Host
from drivers.gnss.corrections.attempts import Attempts
from drivers.gnss.corrections.frames import BATCH, Frames, Take
from drivers.gnss.options import TCP

CONNECT_S = 10.0
SILENT_S = 60.0  # a server that is silent for this time is lost; a caster sends every second
# After this number of octets without an RTCM frame the server does not send RTCM. It may be a web server, or an NTRIP
# caster that requires a login.
MAX_GARBAGE = 8192


class _Connection:
    """A socket that connects or is connected to the server; it is on the loop until it is closed."""

    def __init__(self, opened: socket.socket, on_ready: Callable[["_Connection"], None]) -> None:
        self.socket = opened
        self._on_ready = on_ready

    def fileno(self) -> int:
        return self.socket.fileno()

    def ready(self, events: int) -> None:
        self._on_ready(self)


class TcpCorrections:
    """Client of the server. It reconnects after every failure, with growing delays."""

    def __init__(self, server: Address, host: Host, take: Take) -> None:
        self._loop = host.loop
        self._server = server
        self._frames = Frames(host, take)
        self._attempts = Attempts(f"{TCP}{server}", host, self._frames)
        self._connection: _Connection | None = None
        self._state = "not connected"
        self._connect()

    def close(self) -> None:
        self._attempts.close()
        self._hang_up()
        self._state = "closed"

    def details(self) -> dict[str, object]:
        return {"source": f"{TCP}{self._server}", "state": self._state, **self._frames.details()}

    def _connect(self) -> None:
        self._attempts.begin()
        self._state, self._frames.garbage = "connecting", 0
        try:
            opened = socket.socket(socket.AF_INET, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        except OSError as error:
            self._lose(_why(error.errno))
            return
        number = opened.connect_ex(self._server)
        if number not in (0, errno.EINPROGRESS):
            opened.close()
            self._lose(_why(number))
            return
        self._connection = _Connection(opened, self._ready)
        self._loop.add(self._connection, WRITE)
        self._attempts.wait(CONNECT_S, lambda: self._lose(f"no answer within {CONNECT_S:.0f} s"))

    def _ready(self, connection: _Connection) -> None:
        if self._state == "connecting":
            self._connected(connection)
        else:
            self._read(connection.socket)

    def _connected(self, connection: _Connection) -> None:
        number = connection.socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if number:
            self._lose(_why(number))
            return
        self._state = "connected"
        self._loop.want(connection, READ)
        self._attempts.wait(SILENT_S, self._look)

    def _read(self, connected: socket.socket) -> None:
        try:
            octets = connected.recv(BATCH)
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(_why(error.errno))
            return
        if not octets:
            self._lose("the server closed the connection")
            return
        self._frames.receive(octets)
        if self._connection is not None and self._frames.garbage > MAX_GARBAGE:
            self._lose("not RTCM 3")

    def _look(self) -> None:
        last = self._frames.last
        if not self._attempts.has_frames or last is None or self._loop.clock() - last >= SILENT_S:
            self._lose(f"no RTCM for {SILENT_S:.0f} s")
        else:
            self._attempts.wait(SILENT_S - (self._loop.clock() - last), self._look)

    def _lose(self, why: str) -> None:
        """Close the connection and connect again later."""
        self._hang_up()
        self._state = f"not connected: {why}"
        self._attempts.failed(self._state, self._connect)

    def _hang_up(self) -> None:
        if self._connection is not None:
            self._loop.remove(self._connection)
            self._connection.socket.close()
            self._connection = None


def _why(number: int | None) -> str:
    return os.strerror(number or 0).lower()
