"""Corrections from a TCP server that sends RTCM to who connects."""

import errno
import os
import socket

from board.address import Address
from board.loop import READ, WRITE
from drivers.contract import Host
from drivers.gnss_options import TCP
from drivers.gnss_rtcm import BATCH, Attempts, Frames, Take

CONNECT_S = 10.0
SILENT_S = 60.0  # a caster sends every second
# What is no RTCM for so long never will be: an HTTP page, an NTRIP caster that wants a login.
MAX_GARBAGE = 8192


class TcpCorrections:
    """Its client, which comes back whatever happens, less and less often."""

    def __init__(self, server: Address, host: Host, take: Take) -> None:
        self._loop = host.loop
        self._server = server
        self._frames = Frames(host, take)
        self._attempts = Attempts(f"{TCP}{server}", host, self._frames)
        self._socket: socket.socket | None = None
        self._state = "not connected"
        self._connect()

    def fileno(self) -> int:
        assert self._socket is not None
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        if self._state == "connecting":
            self._connected()
        else:
            self._read()

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
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        except OSError as error:
            self._lose(_why(error.errno))
            return
        number = self._socket.connect_ex(self._server)
        if number not in (0, errno.EINPROGRESS):
            self._lose(_why(number))
            return
        self._loop.add(self, WRITE)
        self._attempts.wait(CONNECT_S, lambda: self._lose(f"no answer within {CONNECT_S:.0f} s"))

    def _connected(self) -> None:
        assert self._socket is not None
        number = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if number:
            self._lose(_why(number))
            return
        self._state = "connected"
        self._loop.want(self, READ)
        self._attempts.wait(SILENT_S, self._look)

    def _read(self) -> None:
        assert self._socket is not None
        try:
            octets = self._socket.recv(BATCH)
        except BlockingIOError:
            return
        except OSError as error:
            self._lose(_why(error.errno))
            return
        if not octets:
            self._lose("the server closed the connection")
            return
        self._frames.receive(octets)
        if self._socket is not None and self._frames.garbage > MAX_GARBAGE:
            self._lose("what it sends is no RTCM 3")

    def _look(self) -> None:
        last = self._frames.last
        if not self._attempts.has_frames or last is None or self._loop.clock() - last >= SILENT_S:
            self._lose(f"no RTCM for {SILENT_S:.0f} s")
        else:
            self._attempts.wait(SILENT_S - (self._loop.clock() - last), self._look)

    def _lose(self, why: str) -> None:
        """Hang up and try again later."""
        self._hang_up()
        self._state = f"not connected: {why}"
        self._attempts.failed(self._state, self._connect)

    def _hang_up(self) -> None:
        if self._socket is not None:
            self._loop.remove(self)
            self._socket.close()
            self._socket = None


def _why(number: int | None) -> str:
    return os.strerror(number or 0).lower()
