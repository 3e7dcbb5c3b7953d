"""Listeners that misbehave before MQTT is spoken: full, silent, closing, babbling. Those that speak it: mute.py."""

import select
import socket
import ssl
import threading
import warnings
from collections.abc import Callable
from typing import Self

from firmware.lab.certificates import Pair
from tests.broker.certificates import Authority

PATIENCE = 5.0  # s; reached only by a test that fails
OVER_FULL = 3  # connections beside the one that a backlog of 0 holds

# What a listener does with a connection; it is closed when this returns. The event: the listener is closed.
Serve = Callable[[socket.socket, threading.Event], None]


class FullBacklog:
    """SYNs get no answer: the queue of a socket that nobody accepts from is full."""

    def __init__(self) -> None:
        self._socket = socket.socket()
        self._socket.bind(("127.0.0.1", 0))
        self._socket.listen(0)
        self.port: int = self._socket.getsockname()[1]
        self._waiting = [socket.socket() for _ in range(1 + OVER_FULL)]
        for number, one in enumerate(self._waiting):
            one.setblocking(False)
            one.connect_ex(("127.0.0.1", self.port))
            if number == 0:
                assert select.select([], [one], [], PATIENCE)[1], "the first connection is not there"

    def close(self) -> None:
        for one in (*self._waiting, self._socket):
            one.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Listener:
    """Accepts, and does with each connection what it is made for, in a thread of its own.

    context  with TLS: the handshake comes first. A client that breaks it off is counted in `broken`.
    """

    def __init__(self, serve: Serve, context: ssl.SSLContext | None = None) -> None:
        self.accepted = 0
        self.broken: list[str] = []
        self._serve = serve
        self._context = context
        self._over = threading.Event()
        self._lines: set[socket.socket] = set()
        self._lock = threading.Lock()
        self._threads: list[threading.Thread] = []
        self._socket = socket.create_server(("127.0.0.1", 0), backlog=64)
        self.port: int = self._socket.getsockname()[1]
        self._accepting = threading.Thread(target=self._accept, daemon=True)
        self._accepting.start()

    def close(self) -> None:
        """Idempotent."""
        if self._over.is_set():
            return
        self._over.set()
        self._socket.shutdown(socket.SHUT_RDWR)  # wakes accept()
        self._accepting.join(PATIENCE)
        self._socket.close()
        with self._lock:
            for line in self._lines:
                _shut(line)
        for thread in self._threads:
            thread.join(PATIENCE)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _accept(self) -> None:
        while not self._over.is_set():
            try:
                line, _ = self._socket.accept()
            except OSError:
                return
            self.accepted += 1
            thread = threading.Thread(target=self._run, args=(line,), daemon=True)
            self._threads.append(thread)
            thread.start()

    def _run(self, line: socket.socket) -> None:
        with self._lock:
            self._lines.add(line)
        try:
            if self._context is None:
                self._serve(line, self._over)
            else:
                with self._context.wrap_socket(line, server_side=True, do_handshake_on_connect=False) as secured:
                    with self._lock:
                        self._lines.add(secured)
                    secured.do_handshake()
                    self._serve(secured, self._over)
        except OSError as error:  # the client went away: ssl's errors are such as well
            self.broken.append(str(error))
        finally:
            with self._lock:
                self._lines = {one for one in self._lines if one.fileno() not in (-1, line.fileno())}
            line.close()


def tls(authority: Authority, server: Pair) -> ssl.SSLContext:
    """Of a server that asks for a client certificate."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(server.certificate, server.key)
    context.load_verify_locations(authority.certificate)
    context.verify_mode = ssl.CERT_REQUIRED
    return context


def old_tls(authority: Authority, server: Pair) -> ssl.SSLContext:
    """Of a server that knows TLS 1.1 at most."""
    context = tls(authority, server)
    context.set_ciphers("ALL:@SECLEVEL=0")
    with warnings.catch_warnings(action="ignore", category=DeprecationWarning):  # that is the point of it
        context.minimum_version = ssl.TLSVersion.TLSv1
        context.maximum_version = ssl.TLSVersion.TLSv1_1
    return context


def silent(_line: socket.socket, over: threading.Event) -> None:
    """Reads nothing and says nothing: a TLS handshake with it stalls, and so does a CONNECT."""
    over.wait()


def closing_after(seconds: float) -> Serve:
    """Closes each connection then; at once with 0."""

    def serve(_line: socket.socket, over: threading.Event) -> None:
        over.wait(seconds)

    return serve


def saying(octets: bytes) -> Serve:
    """Says this, whatever is asked, and reads away what comes."""

    def serve(line: socket.socket, _over: threading.Event) -> None:
        line.sendall(octets)
        while line.recv(1 << 16):
            pass

    return serve


def _shut(line: socket.socket) -> None:
    try:
        # Not ssl's own: it forgets that there is TLS, and whoever still reads is given records as they lie in the kernel.
        socket.socket.shutdown(line, socket.SHUT_RDWR)
    except OSError:
        line.close()  # not connected any more
