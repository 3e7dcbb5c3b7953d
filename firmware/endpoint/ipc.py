"""Driver `ipc`: exchanges RawRxMessages and PDUs with other programs over ipc://."""

import fcntl
import os
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import NamedTuple

import zmq

from board.runtime.errors import InterfaceError, ProtocolError
from board.runtime.loop import Timer
from drivers.contract import BUSY, LATER, NOW, Can, Capabilities, Host, Sent
from drivers.message import Request
from drivers.reason import Reason
from drivers.wire import raw
from firmware.endpoint.inlet import MAX_FRAME, SUB_HWM
from firmware.endpoint.peers.interest import CountedTopics
from firmware.endpoint.publisher import NOBLOCK, Publisher, bind
from firmware.routing.drops import Drops
from firmware.topics import Topics

BATCH = 32
ENVELOPES = b"v2x."  # prefix of all envelopes: the link is up while a process is subscribed to any of them
RETRY_S = 0.05  # pause before the next attempt to send to a slow process, which has up to 16,000 messages to read
# Seconds. Subscriptions of a process arrive one by one. The link is up with the first; the types that the process wants
# are known only after the last.
SETTLE_S = 0.05


class IpcOptions(NamedTuple):
    """Addresses of the two sockets, `ipc://` with a path; an empty one is not opened."""

    ipc_in: str
    ipc_out: str


class Ipc:
    """Driver of the interface `ipc`. It is here and not in drivers/, because only the router may use ZeroMQ.

    The link state concerns sending: the link is up while a process is subscribed. Messages are received in any state.
    If no process subscribes to the type of a request, the request is dropped. In the first SETTLE_S after the link came
    up, it waits.
    """

    def __init__(
        self, context: zmq.Context[zmq.Socket[bytes]], options: IpcOptions, topics: Topics, drops: Drops
    ) -> None:
        # Without an outgoing socket this interface cannot transmit.
        self.capabilities = Capabilities(Can.RECEIVE | Can.TRANSMIT if options.ipc_out else Can.RECEIVE, "ipc")
        self._context = context
        self._options = options
        self._envelopes = topics.envelopes
        self._drops = drops
        self._in: _Incoming | None = None
        self._out: _Outgoing | None = None

    def start(self, host: Host) -> None:
        """Open the sockets. Raises InterfaceError if an address is in use or cannot be opened."""
        ways = f"in {self._options.ipc_in or 'off'}, out {self._options.ipc_out or 'off'}"
        try:
            if self._options.ipc_out:
                self._out = _Outgoing(self._context, self._options.ipc_out, self._envelopes, self._drops, host, ways)
            if self._options.ipc_in:
                self._in = _Incoming(self._context, self._options.ipc_in, host)
        except InterfaceError:
            self.stop()
            raise
        if self._out is None:
            host.link(True, ways)
        else:
            self._out.interest(ENVELOPES, False)

    def send(self, request: Request) -> Sent:
        return BUSY if self._out is None else self._out.send(request)

    def refresh(self) -> None:
        """Do nothing: the kernel has no counters for this interface."""

    def stop(self) -> None:
        if self._in is not None:
            self._in.close()
            self._in = None
        if self._out is not None:
            self._out.close()
            self._out = None


class _Incoming:
    """Socket that receives messages from processes. Raises InterfaceError if it cannot be opened."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], address: str, host: Host) -> None:
        self._host = host
        self._is_scheduled = self._is_closed = False
        with ExitStack() as opening:
            _claim(opening, address, "endpoint.ipc_in")
            self._socket = context.socket(zmq.SUB)
            opening.callback(self._socket.close, 0)
            self._socket.set(zmq.RCVHWM, SUB_HWM)
            self._socket.set(zmq.MAXMSGSIZE, MAX_FRAME)
            self._socket.set(zmq.SUBSCRIBE, b"")
            bind(self._socket, address, "endpoint.ipc_in")
            self._opened = opening.pop_all()
        host.loop.add(self)

    def fileno(self) -> int:
        return self._socket.fileno()

    def ready(self, events: int = 0) -> None:
        if not self._is_scheduled:
            self._take_batch()

    def close(self) -> None:
        self._is_closed = True
        self._host.loop.remove(self)
        self._opened.close()

    def _take_batch(self) -> None:
        self._is_scheduled = False
        for _ in range(BATCH):
            if self._is_closed:  # the last message may have had the effect that the interface was stopped
                return
            try:
                frames = self._socket.recv_multipart(NOBLOCK)
            except zmq.Again:
                return
            self._take(frames)
        self._is_scheduled = True
        self._host.loop.soon(self._take_batch)

    def _take(self, frames: list[bytes]) -> None:
        if len(frames) != 1:
            self._host.drop(Reason.RAW_FORMAT, frames[0])
            return
        try:
            received = raw.parse(frames[0])
        except ProtocolError:
            self._host.drop(Reason.RAW_FORMAT, frames[0])
            return
        self._host.indicate(received.pdu, received.received_ns, received.rx)


class _Outgoing:
    """Socket that publishes PDUs to processes. Raises InterfaceError if it cannot be opened.

    envelopes  envelope of each row of the table of types.
    ways       text with both addresses, for log and status.
    """

    def __init__(
        self,
        context: zmq.Context[zmq.Socket[bytes]],
        address: str,
        envelopes: Sequence[bytes],
        drops: Drops,
        host: Host,
        ways: str,
    ) -> None:
        self._envelopes = envelopes
        self._host = host
        self._ways = ways
        self._retry_timer: Timer | None = None
        self._settled_s = 0.0  # time on the loop's clock from which the subscriptions are complete
        with ExitStack() as opening:
            _claim(opening, address, "endpoint.ipc_out")
            counted = CountedTopics((ENVELOPES,), self.interest, envelopes)
            self._publisher = Publisher(host.loop, context, address, "ipc_out", drops, counted)
            opening.callback(self._publisher.close)
            self._opened = opening.pop_all()

    def send(self, request: Request) -> Sent:
        envelope = self._envelopes[request.kind.row]
        if not self._publisher.wants(envelope):
            if self._host.loop.clock() < self._settled_s:
                return self._again()
            self._host.loop.soon(partial(self._host.confirm, request, Reason.NO_SUBSCRIBER))
            return LATER
        if self._publisher.offer(envelope, request.pdu):
            return NOW
        return self._again()

    def interest(self, topic: bytes, is_wanted: bool) -> None:
        """Set the link up if a process subscribed, or down if the last one left."""
        self._settled_s = self._host.loop.clock() + SETTLE_S
        self._host.link(is_wanted, self._ways if is_wanted else f"{self._ways}: no interface process is subscribed")

    def close(self) -> None:
        self._opened.close()
        if self._retry_timer is not None:
            self._retry_timer.cancel()

    def _again(self) -> Sent:
        self._retry_timer = self._host.loop.after(RETRY_S, self._host.writable)
        return BUSY


def _claim(opening: ExitStack, address: str, option: str) -> None:
    """Lock a path for this station until `opening` is closed. Raises InterfaceError if another station has it."""
    path = address.removeprefix("ipc://")
    if not path.startswith("@"):  # an abstract name has no file; the kernel refuses a second bind
        _make_folder(path, option)
        opening.callback(os.close, _lock(path, option))


def _make_folder(path: str, option: str) -> None:
    folder = Path(path).parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InterfaceError(f"{option}: cannot make {folder}: {error.strerror}") from error


def _lock(path: str, option: str) -> int:
    """Lock the file <path>.lock and return its descriptor. Closing it, or the end of the process, releases the lock.

    Without the lock, libzmq would take over the socket file of a running station: it unlinks the file, then binds. A
    trial connection does not show whether another station runs, because libzmq closes sockets with a delay. The lock
    file is not removed: otherwise two stations could each lock a different file of this name.

    Raises InterfaceError if another station has the lock, or if the file cannot be opened.
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
            hint = "stop that station, or give each station its own path"
            raise InterfaceError(f"{option}: {path} belongs to another station that runs", hint) from error
        raise InterfaceError(f"{option}: cannot lock {file}: {error.strerror}") from error
    return lock
