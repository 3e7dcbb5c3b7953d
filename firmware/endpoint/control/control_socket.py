"""Control socket: Unix socket that answers commands, one JSON line each."""

import contextlib
import errno
import json
import logging
import os
import socket
import tempfile
from collections import deque
from pathlib import Path

from board.runtime.address import check_socket_path
from board.runtime.errors import ConfigurationError, InterfaceError, RequestError
from board.runtime.loop import READ, WRITE, Loop
from firmware.endpoint.control.question import Commands, Pending

MAX_LINE = 4096  # octets of one command
MAX_CLIENTS = 8  # number of connections: enough for a few commands at a time
PAUSE_S = 1.0  # pause after a failed accept(): the socket stays readable, so without a pause the loop would spin

log = logging.getLogger("captain.control")


def default_path(from_users: int) -> str:
    """Return the default path of the control socket: in the first folder that the station may write to."""
    *wanted, last = default_paths(from_users)
    return next((path for path in wanted if os.access(os.path.dirname(path), os.W_OK)), last)


def default_paths(from_users: int) -> list[str]:
    """Return all default paths of the control socket. In the last folder, any user may create a socket.

    from_users  port of from_users, which is part of the file names: it distinguishes several stations of a machine.
    """
    folders = [folder for folder in (os.environ.get("XDG_RUNTIME_DIR"), "/run/captain") if folder]
    # Several network namespaces, each with its own ports, may share one /tmp: the path also contains the namespace.
    network = os.stat("/proc/self/ns/net").st_ino
    nowhere_else = f"{tempfile.gettempdir()}/captain-{os.getuid()}-{network}-{from_users}.sock"
    return [*(f"{folder}/captain-{from_users}.sock" for folder in folders), nowhere_else]


class ControlSocket:
    """Listening socket for commands. Any user who may open the socket may control the station.

    Raises InterfaceError if it cannot listen: the path is too long, in use by another station, or not permitted.
    """

    def __init__(self, loop: Loop, path: str, commands: Commands) -> None:
        self.path = path
        self.commands = commands
        self.clients: dict[Client, None] = {}  # an ordered set: the most recently active client is the last one
        self._loop = loop
        self._socket = _listen(path)
        loop.add(self)

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int) -> None:
        try:
            connection, _ = self._socket.accept()
        except OSError as error:  # the client has closed its connection, or no descriptor is free: try again later
            log.warning("control socket: %s; trying again in %.0f s", error.strerror, PAUSE_S)
            self._loop.want(self, 0)
            self._loop.after(PAUSE_S, self._listen_again)
            return
        if len(self.clients) >= MAX_CLIENTS:
            next(iter(self.clients)).close()  # the first one has been silent for the longest time
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
    """Connection that reads command lines and writes answers, without waiting for a client that does not read.

    Each line is answered before the next line is executed, in a later turn of the loop. Many lines of one client
    therefore do not delay other clients. While a command is executed, nothing is read.
    """

    def __init__(self, loop: Loop, connection: socket.socket, server: ControlSocket) -> None:
        self._loop = loop
        self._connection = connection
        self._server = server
        self._unread = b""
        self._lines: deque[bytes | None] = deque()  # lines to execute; None in place of a line that was too long
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
            else:  # an event although nothing is to be read or written: the client has closed the connection
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
        """Execute one line. The next line is executed after the answer was sent."""
        self._is_scheduled = False
        if self._connection.fileno() < 0:
            return
        self._is_asking = True
        self._pending = Pending(self._loop, self._said)
        line = self._lines.popleft()
        if line is None:
            self._pending.answer(RequestError(f"a line with more than {MAX_LINE} octets", "a command is never"))
        else:
            self._server.commands.ask(line, self._pending)
        self._is_asking = False
        self._write_or_close()

    def _said(self, answer: dict[str, object]) -> None:
        self._pending = None
        self._unsent += json.dumps(answer).encode() + b"\n"
        if not self._is_asking:  # the answer came after _serve() had returned
            self._write_or_close()

    def _write_or_close(self) -> None:
        try:
            self._write()
        except OSError:
            self.close()

    def _write(self) -> None:
        """Send as much of the answers as possible; schedule the next line once all is sent."""
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
    except ConfigurationError as error:  # only a default path can fail: endpoint.control was checked when it was read
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
        busy = "another station uses it; " if error.errno == errno.EADDRINUSE else ""
        raise InterfaceError(
            f"endpoint.control: cannot listen on {path}: {error.strerror or error}",
            f"{busy}choose another path with endpoint.control",
        ) from error
    return listener


def _is_deserted(path: str) -> bool:
    """Return True if the path is a socket file without a listener: a killed station left it."""
    if not Path(path).is_socket():
        return False
    # The probe does not block: with a station that hangs, a blocking connect() would hang as well.
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) as probe:
        try:
            probe.connect(path)
        except ConnectionRefusedError:
            return True
        except OSError:
            return False
    return False
