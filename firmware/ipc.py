"""Interface processes of vehicleCAPTAIN: programs of their own that bring RawRxMessages and take PDUs over ipc://."""

from pathlib import Path
from typing import NamedTuple

import zmq
from zmq.backend import Socket as PlainSocket

from board.errors import InterfaceError, ProtocolError
from drivers.contract import Can, Capabilities, Host, Sent
from drivers.message import Request
from drivers.reason import Reason
from drivers.wire import raw
from firmware.inlet import MAX_FRAME, SUB_HWM
from firmware.publisher import MORE, NOBLOCK, bind

BATCH = 32


class IpcOptions(NamedTuple):
    """Addresses of the two sockets, `ipc://` with a path; either may be empty."""

    ipc_in: str
    ipc_out: str


class Ipc:
    """Lives beside the routing, not among the drivers, because it speaks ZeroMQ, which is the router's alone."""

    def __init__(self, context: zmq.Context[zmq.Socket[bytes]], options: IpcOptions) -> None:
        # Without a socket to send by, nothing may count as sent.
        self.capabilities = Capabilities(Can.RECEIVE | Can.TRANSMIT if options.ipc_out else Can.RECEIVE, "ipc")
        self._context = context
        self._options = options
        self._in: zmq.Socket[bytes] | None = None
        self._out: zmq.Socket[bytes] | None = None
        self._host: Host | None = None

    def start(self, host: Host) -> None:
        self._host = host
        try:
            if self._options.ipc_out:
                self._out = self._bound(zmq.PUB, self._options.ipc_out, "endpoint.ipc_out")
            if self._options.ipc_in:
                self._in = self._bound(zmq.SUB, self._options.ipc_in, "endpoint.ipc_in")
        except InterfaceError:
            self.stop()
            raise
        if self._in is not None:
            self._in.set(zmq.SUBSCRIBE, b"")
            host.loop.add(self)
        host.link(True, f"in {self._options.ipc_in or 'off'}, out {self._options.ipc_out or 'off'}")

    def fileno(self) -> int:
        assert self._in is not None
        return self._in.fileno()

    def ready(self, events: int = 0) -> None:
        if self._in is None or self._host is None:
            return
        for _ in range(BATCH):
            try:
                frames = self._in.recv_multipart(NOBLOCK)
            except zmq.Again:
                return
            self._take(self._host, frames)
        self._host.loop.soon(self.ready)

    def send(self, request: Request) -> Sent:
        if self._out is not None:
            PlainSocket.send(self._out, b"v2x.%s." % request.kind.name.encode(), MORE)
            PlainSocket.send(self._out, request.pdu, NOBLOCK)
        return Sent.NOW

    def refresh(self) -> None:
        """Nothing below counts anything."""

    def stop(self) -> None:
        if self._in is not None:
            assert self._host is not None
            self._host.loop.remove(self)
            self._in.close(0)
            self._in = None
        if self._out is not None:
            self._out.close(0)
            self._out = None

    def _bound(self, kind: int, address: str, option: str) -> "zmq.Socket[bytes]":
        path = Path(address.removeprefix("ipc://"))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InterfaceError(f"{option}: cannot make {path.parent}: {error.strerror}") from error
        socket = self._context.socket(kind)
        socket.set(zmq.RCVHWM, SUB_HWM)
        socket.set(zmq.MAXMSGSIZE, MAX_FRAME)
        bind(socket, address, option)
        return socket

    def _take(self, host: Host, frames: list[bytes]) -> None:
        if len(frames) != 1:
            host.drop(Reason.FRAMING, frames[0])
            return
        try:
            received = raw.parse(frames[0])
        except ProtocolError:
            host.drop(Reason.FRAMING, frames[0])
            return
        host.indicate(received.pdu, received.received_ns, received.rx)
