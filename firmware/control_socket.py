"""The Unix socket of the command line: one JSON object a line, one line back. Whoever may open it may steer."""

import contextlib
import errno
import json
import logging
import os
import socket
import tempfile
from collections import deque
from pathlib import Path

from board.address import check_socket_path
from board.errors import ConfigurationError, InterfaceError, RequestError
from board.loop import READ, WRITE, Loop
from firmware.question import Commands, Pending

MAX_LINE = 4096  # octets of a command
MAX_CLIENTS = 8  # people at a console
PAUSE_S = 1.0  # before the next try when a connection cannot be taken: it stays readable, and would spin the loop

log = logging.getLogger("captain.control")


def default_path(from_users: int) -> str:
    """Where a station listens for commands unless endpoint.control says otherwise: the first place it may write to."""
    *wanted, last = default_paths(from_users)
    return next((path for path in wanted if os.access(os.path.dirname(path), os.W_OK)), last)


def default_paths(from_users: int) -> list[str]:
    """All places where it may listen, named by its first port; in the last folder anybody may listen."""
    folders = [folder for folder in (os.environ.get("XDG_RUNTIME_DIR"), "/run/captain") if folder]
    # Ports are those of a network namespace, and several may share one /tmp.
    network = os.stat("/proc/self/ns/net").st_ino
    nowhere_else = f"{tempfile.gettempdir()}/captain-{os.getuid()}-{network}-{from_users}.sock"
    return [*(f"{folder}/captain-{from_users}.sock" for folder in folders), nowhere_else]


class ControlSocket:
    """Listens and answers."""

    def __init__(self, loop: Loop, path: str, commands: Commands) -> None:
        self.path = path
        self.commands = commands
        self.clients: dict[Client, None] = {}  # the one that asked last at the end
        self._loop = loop
        self._socket = _listen(path)
        loop.add(self)

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        try:
            connection, _ = self._socket.accept()
        except OSError as error:  # it went away again, or descriptors are used up: the next one may have more luck
            log.warning("control socket: %s; trying again in %.0f s", error.strerror, PAUSE_S)
            self._loop.want(self, 0)
            self._loop.after(PAUSE_S, self._listen_again)
            return
        if len(self.clients) >= MAX_CLIENTS:
            next(iter(self.clients)).close()  # silent for the longest
        self.clients[Client(self._loop, connection, self)] = None

    def _listen_again(self) -> None:
        if self._socket.fileno() >= 0:
            self._loop.want(self, READ)

    def close(self) -> None:
        for client in list(self.clients):
            client.close()
        self._loop.remove(self)
        self._socket.close()
        with contextlib.suppress(FileNotFoundError):
            os.unlink(self.path)


class Client:
    """One connection: reads lines, writes answers, never waits for a client that does not read.

    A line is answered before the next is asked, which is in another turn of the loop: many lines at once hold up nobody
    else. While an answer is waited for nothing is read.
    """

    def __init__(self, loop: Loop, connection: socket.socket, server: ControlSocket) -> None:
        self._loop = loop
        self._connection = connection
        self._server = server
        self._unread = b""
        self._lines: deque[bytes | None] = deque()  # None: one that was too long
        self._pending: Pending | None = None
        self._unsent = b""
        self._is_asking = self._is_scheduled = False
        connection.setblocking(False)
        loop.add(self)

    def fileno(self) -> int:
        return self._connection.fileno()

    def ready(self, events: int) -> None:
        try:
            if self._unsent:
                self._write()
            elif self._pending is None and not self._lines:
                self._read()
            else:  # it asked for nothing: the client has hung up
                self.close()
        except BlockingIOError:
            return
        except OSError:
            self.close()

    def close(self) -> None:
        if self._pending is not None:
            self._pending.forget()
        self._loop.remove(self)
        self._connection.close()
        self._server.clients.pop(self, None)

    def _read(self) -> None:
        received = self._connection.recv(MAX_LINE)
        if not received:
            self.close()
            return
        clients = self._server.clients
        clients[self] = clients.pop(self)
        *lines, self._unread = (self._unread + received).split(b"\n")
        self._lines.extend(lines)
        if len(self._unread) > MAX_LINE:
            self._lines.append(None)
            self._unread = b""
        self._write()

    def _serve(self) -> None:
        """Ask one line, and send what was answered; the next has its turn when that has gone."""
        self._is_scheduled = False
        if self._connection.fileno() < 0:
            return
        self._is_asking = True
        self._pending = Pending(self._loop, self._said)
        line = self._lines.popleft()
        if line is None:
            self._pending.answer(RequestError(f"a line of more than {MAX_LINE} octets", "no command is"))
        else:
            self._server.commands.ask(line, self._pending)
        self._is_asking = False
        self._write_or_close()

    def _said(self, answer: dict[str, object]) -> None:
        self._pending = None
        self._unsent += json.dumps(answer).encode() + b"\n"
        if not self._is_asking:  # it has come later
            self._write_or_close()

    def _write_or_close(self) -> None:
        try:
            self._write()
        except OSError:
            self.close()

    def _write(self) -> None:
        """Send what fits; no further line is asked or read before all of it has gone and everything is answered."""
        try:
            sent = self._connection.send(self._unsent) if self._unsent else 0
        except BlockingIOError:
            sent = 0
        self._unsent = self._unsent[sent:]
        is_asking_next = bool(self._lines) and self._pending is None and not self._unsent
        if is_asking_next and not self._is_scheduled:
            self._is_scheduled = True
            self._loop.soon(self._serve)
        is_idle = self._pending is None and not self._lines
        self._loop.want(self, WRITE if self._unsent else READ if is_idle else 0)


def _listen(path: str) -> socket.socket:
    try:
        check_socket_path(path)
    except ConfigurationError as error:  # of the default: endpoint.control is checked when it is read
        hint = f"{error.hint}; choose another path with endpoint.control"
        raise InterfaceError(f"endpoint.control: {error.message}", hint) from error
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        if _is_deserted(path):
            os.unlink(path)
        listener.bind(path)
        os.chmod(path, 0o660)
        listener.listen(MAX_CLIENTS)
    except OSError as error:
        listener.close()
        busy = "another station runs with it; " if error.errno == errno.EADDRINUSE else ""
        raise InterfaceError(
            f"endpoint.control: cannot listen on {path}: {error.strerror or error}",
            f"{busy}choose another path with endpoint.control",
        ) from error
    return listener


def _is_deserted(path: str) -> bool:
    """Whether a socket file is there that nobody listens on any more: a station that was killed left it."""
    if not Path(path).is_socket():
        return False
    # A station that is stuck accepts nobody: whoever waited for it would be stuck as well.
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as probe:
        try:
            probe.connect(path)
        except ConnectionRefusedError:
            return True
        except OSError:
            return False
    return False
