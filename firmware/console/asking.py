"""A question to the station of this machine, over its control socket, without waiting for it."""

import json
import os
import socket
import stat
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from board.errors import StationError
from board.loop import Loop

ANSWER_S = 3.0  # as the other commands give it
MAX_ANSWER = 1 << 20  # octets: of a station with a thousand interfaces
PEER = struct.Struct("=iII")  # struct ucred: process, user, group

Status = dict[str, object]
Answered = Callable[[Status | StationError], None]


class Asking:
    """One question and its answer; answered() is called once, never from here, unless leave() comes first.

    paths  where a station may listen: the first that somebody listens at is asked.
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
            self._fail(f"{len(self._line)} octets without an end of line")
        elif octets.endswith(b"\n"):
            self._read()

    def leave(self) -> None:
        """Ask no more; idempotent."""
        self._answered = None
        self._deadline.cancel()
        if self._socket.fileno() >= 0:
            self._loop.remove(self)
            self._socket.close()

    def _connect(self, paths: Sequence[str]) -> None:
        """To the first that somebody listens at: a station that was killed leaves its own behind. Raises OSError."""
        there = [path for path in paths if os.path.exists(path)]
        if not there:
            raise FileNotFoundError(0, f"there is no {' and no '.join(paths)}")
        for self._path in there[:-1]:
            with suppress(OSError):
                self._socket.connect(self._path)
                return
        self._path = there[-1]
        self._socket.connect(self._path)

    def _look_at_peer(self) -> None:
        """Who listens in a folder where anybody may: another user may be anybody. Raises OSError."""
        if Path(self._path).parent.stat().st_mode & stat.S_IWOTH:
            user = PEER.unpack(self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, PEER.size))[1]
            if user not in (0, os.getuid()):
                raise OSError(0, f"user {user} listens there, who may be anybody")

    def _read(self) -> None:
        try:
            answer = json.loads(self._line)
        except (ValueError, RecursionError):
            answer = None
        status = answer.get("status") if isinstance(answer, dict) else None
        if isinstance(status, dict):
            self._tell(status)
        else:
            self._fail(f"what answers is no station: {bytes(self._line[:40])!r}")

    def _fail(self, why: str) -> None:
        where = f"{self._path}: " if self._path else ""
        self._tell(StationError(f"no station answers: {where}{why}"))

    def _tell(self, answer: Status | StationError) -> None:
        answered = self._answered
        self.leave()
        if answered is not None:
            answered(answer)
