"""Queries the local station over its control socket, without blocking."""

import json
import os
import socket
import stat
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from board.runtime.errors import StationError
from board.runtime.loop import Loop

ANSWER_S = 3.0  # same limit as the other commands
MAX_ANSWER = 1 << 20  # octets; enough for a station with a thousand interfaces
PEER = struct.Struct("=iII")  # struct ucred: process, user, group

Status = dict[str, object]
Answered = Callable[[Status | StationError], None]


class Asking:
    """One query of the station's status. answered() is called once, later, unless leave() was called before.

    paths  candidate sockets; the first one on which a program listens is used.
    """

    def __init__(self, loop: Loop, paths: Sequence[str], answered: Answered) -> None:
        self._loop = loop
        self._answered: Answered | None = answered
        self._path = ""
        self._line = bytearray()
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        self._deadline = loop.after(ANSWER_S, lambda: self._fail(f"no answer within {ANSWER_S:g} s"))
        try:
            self._connect(paths)
            self._look_at_peer()
            self._socket.send(b'{"do": "status"}\n')
            loop.add(self)
        except OSError as error:
            why = error.strerror or str(error)
            loop.soon(lambda: self._fail(why))

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        try:
            octets = self._socket.recv(1 << 16)
        except BlockingIOError:
            return
        except OSError as error:
            self._fail(error.strerror or str(error))
            return
        self._line += octets
        if not octets or len(self._line) > MAX_ANSWER:
            self._fail(f"{len(self._line)} octets without end of line")
        elif octets.endswith(b"\n"):
            self._read()

    def leave(self) -> None:
        """Cancel the query; idempotent."""
        self._answered = None
        self._deadline.cancel()
        if self._socket.fileno() >= 0:
            self._loop.remove(self)
            self._socket.close()

    def _connect(self, paths: Sequence[str]) -> None:
        """Connect to the first path with a listener; a killed station leaves its socket. Raises OSError without one."""
        there = [path for path in paths if os.path.exists(path)]
        if not there:
            raise FileNotFoundError(0, f"no socket {' or '.join(paths)}")
        for self._path in there[:-1]:
            with suppress(OSError):
                self._socket.connect(self._path)
                return
        self._path = there[-1]
        self._socket.connect(self._path)

    def _look_at_peer(self) -> None:
        """Check the listener's user if any user may create sockets in the folder. Raises OSError for a foreign user."""
        if Path(self._path).parent.stat().st_mode & stat.S_IWOTH:
            user = PEER.unpack(self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, PEER.size))[1]
            if user not in (0, os.getuid()):
                raise OSError(0, f"the socket belongs to user {user}, who may not run the station")

    def _read(self) -> None:
        try:
            answer = json.loads(self._line)
        except (ValueError, RecursionError):
            answer = None
        status = answer.get("status") if isinstance(answer, dict) else None
        if isinstance(status, dict):
            self._tell(status)
        else:
            self._fail(f"not a station: {bytes(self._line[:40])!r}")

    def _fail(self, why: str) -> None:
        where = f"{self._path}: " if self._path else ""
        self._tell(StationError(f"no station answers: {where}{why}"))

    def _tell(self, answer: Status | StationError) -> None:
        answered = self._answered
        self.leave()
        if answered is not None:
            answered(answer)
