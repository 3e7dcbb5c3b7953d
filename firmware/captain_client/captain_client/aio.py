"""Station for asyncio: the same client as captain_client.Station, for any number of tasks of one event loop.

async with Station() as box:
    await (await box.send("cam", speed=13.9)).confirmed()
    async for message in box.listen("denm"):
        print(message.station, message.get("cause"))
"""

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import Any, Generic, TypeVar

import zmq
import zmq.asyncio

from captain_client import control
from captain_client.address import Address, parse
from captain_client.errors import UnreachableError
from captain_client.message import Message
from captain_client.reception import Reception, Tally
from captain_client.reports import Frame, frame_of, object_of
from captain_client.requests import STATUS, Confirmed, Request, Requests, outgoing
from captain_client.sockets import (
    ANSWER_S,
    AT_ONCE,
    CONFIRM,
    HIGH_WATER,
    HIGH_WATER_OF_REPORTS,
    connect,
    ms_until,
    topics_of,
    unreachable,
)

__all__ = ["Sent", "Station", "Subscription"]

T = TypeVar("T")
PROBE_S = 0.5  # time limit for a TCP connection that finds out why no station answers


class Station:
    """Connection to one station. Create it in a coroutine, and use it in `async with`.

    It reconnects by itself when the station is restarted. Parameters: those of captain_client.Station.

    Raises ValueError for an invalid address. `async with` raises UnreachableError if no station answers within
    timeout_s.
    """

    def __init__(self, address: str | Address = "", *, timeout_s: float = ANSWER_S, control: str = "") -> None:
        self.address = parse(address) if isinstance(address, str) else address
        self._timeout_s = timeout_s
        self._control = control
        self._tally = Tally()
        self._requests = Requests()
        self._context = zmq.asyncio.Context()
        self._reader: asyncio.Task[None] | None = None
        try:
            self._reports = Inlet(self._context, self.address, CONFIRM, STATUS, most=HIGH_WATER_OF_REPORTS)
            self._push = self._context.socket(zmq.PUSH)
            connect(self._push, self.address, self.address.pull)
            self._plain_push: zmq.Socket[bytes] = zmq.Socket.shadow(self._push)
        except BaseException:
            self._context.destroy(linger=0)
            raise

    async def __aenter__(self) -> "Station":
        try:
            await self._join()
        except BaseException:
            await self.close()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close all sockets. Messages that libzmq has not yet written are discarded: wait for confirmed() before."""
        if self._reader is not None:
            self._reader.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._reader
        self._context.destroy(linger=0)

    # -- sending

    async def send(
        self,
        kind: str,
        message: bytes | bytearray | memoryview | Mapping[str, Any] | None = None,
        /,
        *,
        form: str = "",
        edition: str = "",
        options: Mapping[str, Any] | None = None,
        **fields: Any,
    ) -> "Sent":
        """Send a message: fields, a dict, or the octets of a PDU. Parameters: those of captain_client.Station.send().

        Raises ValueError for contradictory arguments, and UnreachableError if the station does not take the message
        within the timeout of the constructor. The station's own refusal is raised by confirmed().
        """
        out = outgoing(kind, message, form, edition, options, fields)
        deadline = time.monotonic() + self._timeout_s
        while True:
            request, frames = self._requests.open(kind, out, time.monotonic())
            try:
                self._plain_push.send_multipart(frames, zmq.NOBLOCK)
            except zmq.Again:  # the connection has ended
                self._requests.forget(request)
            else:
                return Sent(request)
            await self._writable(deadline)

    # -- receiving

    def listen(self, *types: str, timeout_s: float | None = None) -> "Subscription[Message]":
        """Return an asynchronous iterator over received messages.

        In `async with`, its subscription has reached the station when the block begins; otherwise with the first
        message.

        types      message types, such as `cam`; default: all.
        timeout_s  end the iteration if no message arrives for this time in seconds; default: wait without limit.
        """
        return self._subscription(topics_of("message", *types), Reception(self._tally).read, timeout_s)

    def indications(self, *types: str, timeout_s: float | None = None) -> "Subscription[dict[str, Any]]":
        """Return an iterator over indications: the receptions of each interface, duplicates included."""
        return self._subscription(topics_of("indication", *types), object_of, timeout_s)

    def confirms(self, *types: str, timeout_s: float | None = None) -> "Subscription[dict[str, Any]]":
        """Return an iterator over the confirms of all users' requests."""
        return self._subscription(topics_of("confirm", *types), object_of, timeout_s)

    def frames(self, *interfaces: str, timeout_s: float | None = None) -> "Subscription[Frame]":
        """Return an iterator over frames that come and leave."""
        return self._subscription(topics_of("frame", *interfaces), frame_of, timeout_s)

    async def status(self) -> dict[str, Any]:
        """Return the station's status. Raises UnreachableError if none arrives within ANSWER_S."""
        return await self._next(STATUS)

    async def time(self) -> dict[str, Any]:
        """Return the next object of topic `time.`, which the station sends once a second.

        Raises UnreachableError if none arrives within ANSWER_S.
        """
        return await self._next(b"time.")

    @property
    def missed(self) -> int:
        """Number of messages that all iterators of listen() have missed."""
        return self._tally.missed

    @property
    def malformed(self) -> int:
        """Number of malformed reports, which were skipped."""
        return self._tally.malformed

    # -- commands

    async def trigger(self, text: str) -> None:
        """Tell the recorder to keep its recent recording. text: reason.

        Raises RefusedError if the station has no recorder, and StationError if it is not on this machine.
        """
        await self._ask("record", control.ANSWER_S, text=text)

    async def reload_policy(self) -> None:
        """Tell the station to read its policy again, from its configuration.

        Raises RefusedError if the configuration is invalid, and StationError if the station is not on this machine.
        """
        await self._ask("reload", control.RELOAD_S)

    # -- sockets

    async def unreachable(self, port: int) -> UnreachableError:
        """Return the error for a port at which no station answers."""
        try:
            opened = asyncio.open_connection(self.address.host, port)
            _, writer = await asyncio.wait_for(opened, PROBE_S)
        except (OSError, UnicodeError, asyncio.TimeoutError) as error:  # UnicodeError: an invalid host name
            return unreachable(self.address, port, getattr(error, "strerror", None) or str(error) or "timeout")
        writer.close()
        return unreachable(self.address, port, "")

    async def _join(self) -> None:
        """Wait for the first status, and for the connection to the PULL port."""
        deadline = time.monotonic() + self._timeout_s
        while self._requests.run is None:
            frames = await self._reports.next(deadline)
            if frames is None:
                raise await self.unreachable(self.address.report)
            self._requests.report(frames, time.monotonic())
        await self._writable(deadline)
        self._reader = asyncio.create_task(self._read())

    async def _writable(self, deadline: float) -> None:
        """Wait for the connection to the PULL port. Raises UnreachableError at the deadline."""
        while not self._plain_push.poll(0, zmq.POLLOUT):
            if not (left_ms := ms_until(deadline)):
                raise await self.unreachable(self.address.pull)
            # Another task may use up the event: then poll() returns 0 before its timeout.
            await self._push.poll(left_ms, zmq.POLLOUT)  # type: ignore[call-arg]  # the stub has no flags

    async def _read(self) -> None:
        """Give confirms and statuses to the open requests, until the task is cancelled."""
        while (frames := await self._reports.next(None)) is not None:
            self._requests.report(frames, time.monotonic())

    def _subscription(
        self, topics: tuple[bytes, ...], read: Callable[[list[bytes]], T | None], timeout_s: float | None
    ) -> "Subscription[T]":
        inlet = Inlet(self._context, self.address, *topics, STATUS)
        return Subscription(self, inlet, topics, read, (self._timeout_s, timeout_s))

    async def _next(self, topic: bytes) -> dict[str, Any]:
        async with self._subscription((topic,), object_of, ANSWER_S) as reports:
            async for report in reports:
                return report
        raise await self.unreachable(self.address.report)

    async def _ask(self, do: str, within_s: float, **more: object) -> None:
        path = control.path_of(self.address, self._control)
        try:
            reader, writer = await asyncio.open_unix_connection(path, limit=control.MOST_OCTETS)
            with contextlib.closing(writer):
                control.check_peer(path, writer.get_extra_info("socket"))
                writer.write(control.question(do, within_s, more))
                line = await asyncio.wait_for(reader.readline(), within_s + 1.0)
        except asyncio.TimeoutError as error:
            raise control.unanswered(path, TimeoutError(0, "timeout")) from error
        except OSError as error:
            raise control.unanswered(path, error) from error
        control.answer_of(path, line)


class Sent:
    """Message that was given to the station.

    label  label in its confirms.
    """

    def __init__(self, request: Request) -> None:
        self.label = request.label
        self._request = request
        self._over = asyncio.Event()
        request.on_over = self._over.set

    async def confirmed(self, timeout_s: float = ANSWER_S) -> Confirmed:
        """Wait until each interface has confirmed the message. Return the interfaces that sent it.

        Raises RefusedError if the station refused it or no interface sent it, and UnconfirmedError after timeout_s
        seconds, or if the station was restarted meanwhile.
        """
        if not self._request.is_over:
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._over.wait(), timeout_s)
        return self._request.outcome()


class Inlet:
    """SUB socket that is read in batches: waiting costs ten times as much as reading.

    Parameters: those of sockets.connect().
    """

    def __init__(self, context: zmq.asyncio.Context, address: Address, *topics: bytes, most: int = HIGH_WATER) -> None:
        self._socket = context.socket(zmq.SUB)
        connect(self._socket, address, address.report, *topics, most=most)
        self._plain: zmq.Socket[bytes] = zmq.Socket.shadow(self._socket)
        self._arrived: deque[list[bytes]] = deque()

    async def next(self, deadline: float | None) -> list[bytes] | None:
        """Return the next message; None at the deadline, a time of the monotonic clock in seconds."""
        self._take()
        while not self._arrived:
            left_ms = None if deadline is None else ms_until(deadline)
            if left_ms == 0:
                return None
            await self._socket.poll(left_ms)  # may return before its timeout without a message
            self._take()
        return self._arrived.popleft()

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


class Subscription(Generic[T]):
    """Asynchronous iterator over the reports of some topics. Leave its `async with` block to end the subscription.

    read   returns the object of a report; None for a malformed one, which is skipped.
    waits  seconds to wait for the proof of the subscription, and for each report; None: no limit.
    """

    def __init__(
        self,
        station: Station,
        inlet: Inlet,
        topics: tuple[bytes, ...],
        read: Callable[[list[bytes]], T | None],
        waits: tuple[float, float | None],
    ) -> None:
        self._station = station
        self._inlet = inlet
        self._topics = topics
        self._read = read
        self._join_s, self._timeout_s = waits
        self._has_joined = False
        self._early: deque[list[bytes]] = deque()

    def __del__(self) -> None:
        self.close()  # `async for message in box.listen()` leaves it to the collector

    def __aiter__(self) -> "Subscription[T]":
        return self

    async def __anext__(self) -> T:
        if not self._has_joined:
            await self._join()
        while (frames := await self._take()) is not None:
            if frames[0].startswith(self._topics) and (found := self._read(frames)) is not None:
                return found
        raise StopAsyncIteration

    async def __aenter__(self) -> "Subscription[T]":
        await self._join()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the subscription."""
        self._inlet.close()

    async def _join(self) -> None:
        """Wait for a status, which proves the subscription. Keep reports that come before it."""
        deadline = time.monotonic() + self._join_s
        while not self._has_joined:
            frames = await self._inlet.next(deadline)
            if frames is None:
                raise await self._station.unreachable(self._station.address.report)
            self._early.append(frames)
            self._has_joined = frames[0] == STATUS
        if STATUS not in self._topics:
            self._inlet.unsubscribe(STATUS)

    async def _take(self) -> list[bytes] | None:
        if self._early:
            return self._early.popleft()
        return await self._inlet.next(None if self._timeout_s is None else time.monotonic() + self._timeout_s)
