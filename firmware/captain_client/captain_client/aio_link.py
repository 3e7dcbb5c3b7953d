"""asyncio link to a station: sockets for requests, confirms and subscriptions."""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Iterator
from weakref import WeakSet

import zmq
import zmq.asyncio

from captain_client.address import Address
from captain_client.errors import StationError, UnreachableError
from captain_client.link import PROBE_S
from captain_client.requests import STATUS, Outgoing, Request, Requests
from captain_client.sockets import (
    AT_ONCE,
    CONFIRM,
    EVENT_MS,
    HIGH_WATER,
    HIGH_WATER_OF_REPORTS,
    OPEN,
    ask_for_status,
    check_open,
    connect,
    connections_of,
    has_connected,
    ms_until,
    offered,
    unreachable,
)

EVENT_S = 0.01  # pause for the event of a connection; while a task waits for it, the others go on


class Inlet:
    """SUB socket that is read in batches: waiting costs ten times as much as reading.

    topics, most  as of sockets.connect().
    """

    def __init__(self, context: zmq.asyncio.Context, address: Address, *topics: bytes, most: int = HIGH_WATER) -> None:
        self._socket = context.socket(zmq.SUB)
        connect(self._socket, address.url(address.report), *topics, most=most)
        self._plain: zmq.Socket[bytes] = zmq.Socket.shadow(self._socket)
        self._arrived: deque[list[bytes]] = deque()

    async def next(self, deadline: float | None) -> list[bytes] | None:
        """Return the next message; None at the deadline, a time of the monotonic clock in seconds.

        Raises StationError if the inlet is closed, even meanwhile.
        """
        check_open(self._socket)
        self._take()
        while not self._arrived:
            left_ms = None if deadline is None else ms_until(deadline)
            if left_ms == 0:
                return None
            await _event(self._socket, left_ms)
            self._take()
        return self._arrived.popleft()

    def waiting(self) -> Iterator[list[bytes]]:
        """Yield the messages that have arrived."""
        self._take()
        while self._arrived:
            yield self._arrived.popleft()
            self._take()

    def ask_for_status(self) -> None:
        """Ask the station for a status, which proves the subscriptions."""
        ask_for_status(self._plain)

    def unsubscribe(self, topic: bytes) -> None:
        self._plain.unsubscribe(topic)

    def close(self) -> None:
        self._socket.close()

    def _take(self) -> None:
        for _ in range(0 if self._arrived else AT_ONCE):
            try:
                self._arrived.append(self._plain.recv_multipart(zmq.NOBLOCK))
            except zmq.Again:
                return


async def _event(end: zmq.asyncio.Socket, left_ms: int | None, flags: int = zmq.POLLIN) -> None:
    """Wait for an event of a socket, at most left_ms. May return before without one, if another task uses it up.

    Raises StationError if the socket is closed, even meanwhile.
    """
    check_open(end)
    try:
        await end.poll(left_ms, flags)  # type: ignore[call-arg]  # the stub has no flags
    except asyncio.CancelledError:
        check_open(end)  # close() of a socket cancels what waits for it
        raise


class Link:
    """Sockets to one station. Create it in a coroutine, then await join().

    timeout_s  seconds to wait for the station: in join(), in send() and for each subscription.

    Raises ValueError for an invalid host name.
    """

    def __init__(self, address: Address, timeout_s: float) -> None:
        self.timeout_s = timeout_s
        self._address = address
        self._requests = Requests()
        self._context = zmq.asyncio.Context()
        OPEN.add(self._context)
        self._reader: asyncio.Task[None] | None = None
        self._inlets = WeakSet[Inlet]()
        self._proof = 1  # number of the status that proves the subscriptions of _reports
        self._has_status = asyncio.Event()
        try:
            self._reports = Inlet(self._context, address, CONFIRM, STATUS, most=HIGH_WATER_OF_REPORTS)
            self._push = self._context.socket(zmq.PUSH)
            self._connections = connections_of(self._push)
            self._plain_push: zmq.Socket[bytes] = zmq.Socket.shadow(self._push)
        except BaseException:
            self._context.destroy()
            OPEN.discard(self._context)
            raise

    async def join(self) -> None:
        """Wait for the first status, and for the connection to the PULL port. Then read confirms in a task.

        Raises UnreachableError if no station answers in time.
        """
        deadline = time.monotonic() + self.timeout_s
        self._reader = asyncio.create_task(self._read())
        await self._prove(deadline)
        connect(self._push, self._address.url(self._address.pull))
        await self._writable(deadline)
        has_connected(self._connections, EVENT_MS)  # later ones are interruptions

    async def close(self) -> None:
        if self._reader is not None:
            self._reader.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._reader
        self._push.close()
        self._connections.close()
        self._reports.close()
        self._has_status.set()  # tasks that wait for it find the socket closed
        for inlet in self._inlets:
            inlet.close()
        self._requests.close()
        OPEN.discard(self._context)
        await asyncio.to_thread(self._context.term)  # waits up to LINGER_MS for requests that are not yet written

    async def send(self, kind: str, out: Outgoing) -> Request:
        """Send a request.

        Raises UnreachableError if the station does not take it in time. Raises StationError before join() and after
        close().
        """
        check_open(self._push)
        if self._reader is None:
            raise StationError("the client is not connected", "use it in `async with`")
        deadline = time.monotonic() + self.timeout_s
        while True:
            await self._writable(deadline)
            await self._prove(deadline)
            if (request := offered(self._plain_push, self._requests, kind, out)) is not None:
                return request

    def subscribe(self, topics: tuple[bytes, ...]) -> Inlet:
        """Return a new inlet, subscribed in the background to topics and to a status.

        Raises StationError after close().
        """
        check_open(self._push)
        inlet = Inlet(self._context, self._address, *topics, STATUS)
        self._inlets.add(inlet)
        return inlet

    async def first_status(self, inlet: Inlet) -> deque[list[bytes]]:
        """Return the messages of a new inlet up to the first status, which proves its subscriptions.

        Raises UnreachableError if none comes in time.
        """
        deadline = time.monotonic() + self.timeout_s
        early: deque[list[bytes]] = deque()
        while not early or early[-1][0] != STATUS:
            frames = await inlet.next(deadline)
            if frames is None:
                raise await self.unreachable(self._address.report)
            early.append(frames)
        return early

    async def unreachable(self, port: int) -> UnreachableError:
        """Return the error for a port at which no station answers, with the cause."""
        try:
            opened = asyncio.open_connection(self._address.host, port)
            _, writer = await asyncio.wait_for(opened, PROBE_S)
        except (OSError, UnicodeError, asyncio.TimeoutError) as error:  # UnicodeError: an invalid host name
            return unreachable(self._address, port, getattr(error, "strerror", None) or str(error) or "timeout")
        writer.close()
        return unreachable(self._address, port, "")

    async def _writable(self, deadline: float) -> None:
        """Wait for the connection to the PULL port, and for its event.

        Raises UnreachableError at the deadline, and StationError if the link is closed.
        """
        while not self._plain_push.poll(0, zmq.POLLOUT):
            if not (left_ms := ms_until(deadline)):
                raise await self.unreachable(self._address.pull)
            await _event(self._push, left_ms, zmq.POLLOUT)
            await asyncio.sleep(EVENT_S)
            check_open(self._push)

    async def _prove(self, deadline: float) -> None:
        """Wait for a status at the start and after an interruption: it proves the subscription to confirms.

        Raises UnreachableError at the deadline, and StationError if the link is closed.
        """
        while True:
            if has_connected(self._connections):
                for frames in self._reports.waiting():
                    self._requests.report(frames)
                self._proof = self._requests.statuses + 1
                self._reports.ask_for_status()
            if self._requests.statuses >= self._proof:
                return
            self._has_status.clear()
            try:
                await asyncio.wait_for(self._has_status.wait(), deadline - time.monotonic())
            except asyncio.TimeoutError as error:
                raise await self.unreachable(self._address.report) from error
            check_open(self._push)

    async def _read(self) -> None:
        """Give confirms and statuses to the open requests, until the task is cancelled."""
        while (frames := await self._reports.next(None)) is not None:
            self._requests.report(frames)
            if frames[0] == STATUS:
                self._has_status.set()
