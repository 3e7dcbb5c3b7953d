"""Where corrections come from: a file, or a TCP server. Only whole RTCM 3 frames are passed on."""

import errno
import logging
import os
import socket
from collections.abc import Callable
from typing import IO, Protocol

from board.address import Address, address
from board.errors import InterfaceError
from board.loop import READ, WRITE, Loop, Timer
from drivers.contract import Host
from drivers.gnss_options import TCP
from drivers.reason import Reason
from drivers.wire.gnss_stream import GnssStream
from drivers.wire.rtcm import Frame
from drivers.wire.serial_frame import Garbage

log = logging.getLogger("captain.gnss")

Take = Callable[[bytes], None]

BATCH = 1024  # octets read in one turn

# A file is replayed at the rate of a line: RTCM for four systems has some 1000 octets a second.
FILE_PERIOD_S = 0.25

CONNECT_S = 10.0
SILENT_S = 60.0  # a caster sends every second
FIRST_S, MOST_S = 1.0, 60.0  # between two tries
# What is no RTCM for so long never will be: an HTTP page, an NTRIP caster that wants a login.
MAX_GARBAGE = 8192


class Corrections(Protocol):
    """A source of RTCM frames that was started."""

    def close(self) -> None:
        """Idempotent."""

    def details(self) -> dict[str, object]:
        """What status shows of it."""


def corrections(where: str, host: Host, take: Take) -> Corrections | None:
    """Open what the option says. Raises InterfaceError for a file that cannot be read; a server may come later."""
    if not where:
        return None
    if where.startswith(TCP):
        return TcpCorrections(address(where.removeprefix(TCP)), host, take)
    return FileCorrections(where, host, take)


class _Frames:
    """Octets to frames, counted."""

    def __init__(self, host: Host, take: Take) -> None:
        self.count = 0
        self.garbage = 0  # octets since the last frame
        self.last: float | None = None
        self._host = host
        self._take = take
        self._stream = GnssStream()

    def receive(self, octets: bytes) -> None:
        now = self._host.loop.clock()
        for event in [*self._stream.expire(now), *self._stream.receive(octets, now)]:
            if isinstance(event, Frame):
                self.count += 1
                self.garbage, self.last = 0, now
                self._take(event.octets)
            elif isinstance(event, Garbage):
                self.garbage += event.octets
                self._host.drop(event.reason, event.sample)
            else:
                self._host.drop(Reason.FRAMING)

    def details(self) -> dict[str, object]:
        since = None if self.last is None else round(self._host.loop.clock() - self.last, 1)
        return {"frames": self.count, "last_s": since}


class FileCorrections:
    """Replays a file and then waits for what is appended to it."""

    def __init__(self, path: str, host: Host, take: Take) -> None:
        self._loop = host.loop
        self._path = path
        self._frames = _Frames(host, take)
        try:
            # Never waits: with O_NONBLOCK a pipe without a writer is empty.
            self._file: IO[bytes] = open(path, "rb", buffering=0, opener=_open)  # noqa: SIM115 until close()
        except OSError as error:
            raise InterfaceError(f"corrections: {path}: {error.strerror}", "name a file with RTCM 3 frames") from error
        self._timer: Timer | None = self._loop.after(FILE_PERIOD_S, self._read)

    def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
            self._file.close()

    def details(self) -> dict[str, object]:
        return {"source": self._path, **self._frames.details()}

    def _read(self) -> None:
        self._timer = self._loop.after(FILE_PERIOD_S, self._read)
        octets = self._file.read(BATCH)  # None: a pipe has nothing now
        if octets:
            self._frames.receive(octets)


def _open(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK | os.O_CLOEXEC)


class TcpCorrections:
    """A client of a server that sends RTCM to who connects. It comes back whatever happens, less and less often."""

    def __init__(self, server: Address, host: Host, take: Take) -> None:
        self._loop: Loop = host.loop
        self._server = server
        self._name = host.name
        self._frames = _Frames(host, take)
        self._socket: socket.socket | None = None
        self._timer: Timer | None = None
        self._state = "not connected"
        self._delay = FIRST_S
        self._begun = 0  # frames that had come before this connection
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
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._hang_up()
        self._state = "closed"

    def details(self) -> dict[str, object]:
        return {"source": f"{TCP}{self._server}", "state": self._state, **self._frames.details()}

    def _connect(self) -> None:
        self._state, self._begun, self._frames.garbage = "connecting", self._frames.count, 0
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
        self._wait(CONNECT_S, lambda: self._lose(f"no answer within {CONNECT_S:.0f} s"))

    def _connected(self) -> None:
        assert self._socket is not None
        number = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if number:
            self._lose(_why(number))
            return
        self._state = "connected"
        self._loop.want(self, READ)
        self._wait(SILENT_S, self._look)

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
        if self._frames.count == self._begun or last is None or self._loop.clock() - last >= SILENT_S:
            self._lose(f"no RTCM for {SILENT_S:.0f} s")
        else:
            self._wait(SILENT_S - (self._loop.clock() - last), self._look)

    def _lose(self, why: str) -> None:
        """Hang up and try again later; the same reason is logged once."""
        why = f"not connected: {why}"
        if self._frames.count > self._begun:
            self._delay = FIRST_S
        self._hang_up()
        if why != self._state and self._delay == FIRST_S:
            log.warning(
                "%s: corrections from %s: %s; trying again, at most every %.0f s", self._name, self._server, why, MOST_S
            )
        self._state = why
        self._wait(self._delay, self._connect)
        self._delay = min(MOST_S, 2 * self._delay)

    def _hang_up(self) -> None:
        if self._socket is not None:
            self._loop.remove(self)
            self._socket.close()
            self._socket = None

    def _wait(self, seconds: float, call: Callable[[], None]) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._loop.after(seconds, call)


def _why(number: int | None) -> str:
    return os.strerror(number or 0).lower()
