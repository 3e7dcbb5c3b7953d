"""Interface processes of vehicleCAPTAIN: programs of their own that bring RawRxMessages and take PDUs over ipc://."""

import fcntl
import os
from functools import partial
from pathlib import Path
from typing import NamedTuple

import zmq

from board.errors import InterfaceError, ProtocolError
from board.loop import Timer
from drivers.contract import BUSY, LATER, NOW, Can, Capabilities, Host, Sent
from drivers.message import Request
from drivers.reason import Reason
from drivers.wire import raw
from firmware.drops import Drops
from firmware.inlet import MAX_FRAME, SUB_HWM
from firmware.publisher import NOBLOCK, Publisher, bind
from firmware.topics import Topics

BATCH = 32
ENVELOPES = b"v2x."  # a process that takes any of them makes the link
RETRY_S = 0.05  # a process that does not keep up has 16,000 messages to read meanwhile


class IpcOptions(NamedTuple):
    """Addresses of the two sockets, `ipc://` with a path; either may be empty."""

    ipc_in: str
    ipc_out: str


class Ipc:
    """Lives beside the routing, not among the drivers, because it speaks ZeroMQ, which is the router's alone.

    Its link is that of sending: up while a process is subscribed. What processes bring passes whatever the link is.
    A type that none of them takes is dropped at once: it may be that none ever will.
    """

    def __init__(
        self, context: zmq.Context[zmq.Socket[bytes]], options: IpcOptions, topics: Topics, drops: Drops
    ) -> None:
        # Without a socket to send by, nothing may count as sent.
        self.capabilities = Capabilities(Can.RECEIVE | Can.TRANSMIT if options.ipc_out else Can.RECEIVE, "ipc")
        self._context = context
        self._options = options
        self._envelopes = topics.envelopes
        self._drops = drops
        self._in: zmq.Socket[bytes] | None = None
        self._out: Publisher | None = None
        self._host: Host | None = None
        self._is_scheduled = False
        self._retry_timer: Timer | None = None
        self._locks: list[int] = []

    def start(self, host: Host) -> None:
        self._host = host
        try:
            if self._options.ipc_out:
                self._out = self._publisher(host)
            if self._options.ipc_in:
                self._in = self._subscriber()
        except InterfaceError:
            self.stop()
            raise
        if self._in is not None:
            host.loop.add(self)
        self._interest(ENVELOPES, self._out is None)

    def fileno(self) -> int:
        assert self._in is not None
        return self._in.fileno()

    def ready(self, events: int = 0) -> None:
        if not self._is_scheduled:
            self._take_batch()

    def _take_batch(self) -> None:
        self._is_scheduled = False
        if self._in is None or self._host is None:
            return
        for _ in range(BATCH):
            try:
                frames = self._in.recv_multipart(NOBLOCK)
            except zmq.Again:
                return
            self._take(self._host, frames)
        self._is_scheduled = True
        self._host.loop.soon(self._take_batch)

    def send(self, request: Request) -> Sent:
        assert self._out is not None
        assert self._host is not None
        envelope = self._envelopes[request.kind.row]
        if not self._out.wants(envelope):
            self._host.loop.soon(partial(self._host.confirm, request, Reason.NO_SUBSCRIBER))
            return LATER
        if self._out.offer(envelope, request.pdu):
            return NOW
        self._retry_timer = self._host.loop.after(RETRY_S, self._host.writable)
        return BUSY

    def refresh(self) -> None:
        """Nothing below counts anything."""

    def stop(self) -> None:
        if self._in is not None:
            assert self._host is not None
            self._host.loop.remove(self)
            self._in.close(0)
            self._in = None
        if self._out is not None:
            self._out.close()
            self._out = None
        if self._retry_timer is not None:
            self._retry_timer.cancel()
        while self._locks:
            os.close(self._locks.pop())

    def _interest(self, topic: bytes, is_wanted: bool) -> None:
        """A process subscribed, or the last one left."""
        assert self._host is not None
        ways = f"in {self._options.ipc_in or 'off'}, out {self._options.ipc_out or 'off'}"
        self._host.link(is_wanted, ways if is_wanted else f"{ways}: no interface process is subscribed")

    def _publisher(self, host: Host) -> Publisher:
        self._claim(self._options.ipc_out, "endpoint.ipc_out")
        return Publisher(
            host.loop,
            self._context,
            self._options.ipc_out,
            "ipc_out",
            self._drops,
            (ENVELOPES,),
            self._interest,
            self._envelopes,
        )

    def _subscriber(self) -> "zmq.Socket[bytes]":
        self._claim(self._options.ipc_in, "endpoint.ipc_in")
        socket = self._context.socket(zmq.SUB)
        socket.set(zmq.RCVHWM, SUB_HWM)
        socket.set(zmq.MAXMSGSIZE, MAX_FRAME)
        socket.set(zmq.SUBSCRIBE, b"")
        bind(socket, self._options.ipc_in, "endpoint.ipc_in")
        return socket

    def _claim(self, address: str, option: str) -> None:
        """Make the path this station's until stop(). Raises InterfaceError where it is another's or cannot be had."""
        path = address.removeprefix("ipc://")
        if not path.startswith("@"):  # an abstract name has no file, and the kernel refuses a second of it
            _make_folder(path, option)
            self._locks.append(_lock(path, option))

    def _take(self, host: Host, frames: list[bytes]) -> None:
        if len(frames) != 1:
            host.drop(Reason.RAW_FORMAT, frames[0])
            return
        try:
            received = raw.parse(frames[0])
        except ProtocolError:
            host.drop(Reason.RAW_FORMAT, frames[0])
            return
        host.indicate(received.pdu, received.received_ns, received.rx)


def _make_folder(path: str, option: str) -> None:
    folder = Path(path).parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InterfaceError(f"{option}: cannot make {folder}: {error.strerror}") from error


def _lock(path: str, option: str) -> int:
    """Lock the file <path>.lock; closing the descriptor that is returned, or dying, gives it up.

    libzmq takes a socket's file from whoever has it: it unlinks, then binds. To connect first and see whether anybody
    answers says nothing either, because it closes sockets later than it is told to. The file stays: were it removed,
    two could each lock one of its name.
    """
    file = path + ".lock"
    try:
        lock = os.open(file, os.O_RDONLY | os.O_CREAT | os.O_NOFOLLOW, 0o644)
    except OSError as error:
        raise InterfaceError(f"{option}: cannot lock {file}: {error.strerror}") from error
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(lock)
        if isinstance(error, BlockingIOError):
            hint = "stop that one, or give each station a path of its own"
            raise InterfaceError(f"{option}: {path} belongs to another station that runs", hint) from error
        raise InterfaceError(f"{option}: cannot lock {file}: {error.strerror}") from error
    return lock
