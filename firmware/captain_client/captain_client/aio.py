"""Station for asyncio: the client for the tasks of one event loop.

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
from os import PathLike
from types import TracebackType
from typing import Any, Generic, TypeVar

from captain_client import control
from captain_client.address import Address, parse
from captain_client.aio_link import Inlet, Link
from captain_client.arguments import check_path, check_seconds, check_text
from captain_client.message import Message
from captain_client.reception import Reception, Tally, check_types
from captain_client.reports import Frame, frame_of, object_of
from captain_client.requests import STATUS, Confirmed, Request, outgoing
from captain_client.sockets import ANSWER_S, CONFIRM_S, topics_of, topics_of_types

__all__ = ["Sent", "Station", "Subscription"]

T = TypeVar("T")


class Station:
    """Connection to one station. Create it in a coroutine, and use it in `async with`.

    It reconnects by itself when the station is restarted. Parameters: those of captain_client.Station.

    Raises ValueError for an invalid argument. `async with` raises UnreachableError if no station answers within
    timeout_s.
    """

    def __init__(
        self, address: str | Address = "", *, timeout_s: float = ANSWER_S, control: str | PathLike[str] = ""
    ) -> None:
        self.address = address if isinstance(address, Address) else parse(address)
        check_seconds("timeout_s", timeout_s)
        self._control = check_path("control", control)
        self._tally = Tally()
        self._link = Link(self.address, timeout_s)

    async def __aenter__(self) -> "Station":
        try:
            await self._link.join()
        except BaseException:
            await self.close()
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close all sockets. Requests that libzmq has not yet written are written first, within a second."""
        await self._link.close()

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

        Raises ValueError and UnreachableError as it does.
        """
        return Sent(await self._link.send(kind, outgoing(kind, message, form, edition, options, fields)))

    # -- receiving

    def listen(self, *types: str, timeout_s: float | None = None) -> "Subscription[Message]":
        """Return an asynchronous iterator over received messages.

        In `async with`, its subscription has reached the station when the block begins; otherwise with the first
        message. Both raise UnreachableError if no station answers, and ValueError for a type that it does not know.
        Raises ValueError for an invalid argument.

        types      message types, such as `cam`; default: all.
        timeout_s  end the iteration if no message arrives for this time in seconds; default: wait without limit.
        """
        reception = Reception(self._tally)
        return self._subscription(topics_of_types("message", types), reception.read, timeout_s, reception.begin)

    def indications(self, *types: str, timeout_s: float | None = None) -> "Subscription[dict[str, Any]]":
        """Return an iterator over indications: as captain_client.Station.indications().

        Raises ValueError for an invalid argument.
        """
        return self._subscription(topics_of_types("indication", types), object_of, timeout_s)

    def confirms(self, *types: str, timeout_s: float | None = None) -> "Subscription[dict[str, Any]]":
        """Return an iterator over confirms: as captain_client.Station.confirms().

        Raises ValueError for an invalid argument.
        """
        return self._subscription(topics_of_types("confirm", types), object_of, timeout_s)

    def frames(self, *interfaces: str, timeout_s: float | None = None) -> "Subscription[Frame]":
        """Return an iterator over frames that come and leave. Raises ValueError for an invalid argument."""
        return self._subscription(topics_of("frame", interfaces), frame_of, timeout_s)

    async def status(self) -> dict[str, Any]:
        """Return the station's status. Raises UnreachableError as captain_client.Station.status()."""
        return await self._next(STATUS)

    async def time(self) -> dict[str, Any]:
        """Return the next object of topic `time.`. Raises UnreachableError as captain_client.Station.time()."""
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
        """Trigger the recorder. Raises RefusedError and StationError as captain_client.Station.trigger()."""
        check_text("text", text)
        await self._ask("record", control.COMMAND_S, text=text)

    async def reload_policy(self) -> None:
        """Reload the policy. Raises RefusedError and StationError as captain_client.Station.reload_policy()."""
        await self._ask("reload", control.RELOAD_S)

    def _subscription(
        self,
        topics: tuple[bytes, ...],
        read: Callable[[list[bytes]], T | None],
        timeout_s: float | None,
        begin: Callable[[list[bytes]], object] = bool,
    ) -> "Subscription[T]":
        if timeout_s is not None:
            check_seconds("timeout_s", timeout_s)
        return Subscription(self._link, self._link.subscribe(topics), topics, read, timeout_s, begin)

    async def _next(self, topic: bytes) -> dict[str, Any]:
        async with self._subscription((topic,), object_of, ANSWER_S) as reports:
            async for report in reports:
                return report
        raise await self._link.unreachable(self.address.report)

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

    async def confirmed(self, timeout_s: float = CONFIRM_S) -> Confirmed:
        """Wait for the outcome: as captain_client.Sent.confirmed().

        Raises RefusedError, UnconfirmedError and ValueError.
        """
        check_seconds("timeout_s", timeout_s)
        if not self._request.is_over:
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._over.wait(), timeout_s)
        return self._request.outcome()


class Subscription(Generic[T]):
    """Asynchronous iterator over the reports of some topics. Leave its `async with` block to end the subscription.

    inlet      new inlet of the link, subscribed to the topics and to a status.
    read       returns the object of a report; None for a malformed one, which is skipped.
    timeout_s  end the iteration if no report arrives for this time in seconds; None: no limit.
    begin      takes the status that proves the subscription.

    The iteration raises StationError after close().
    """

    def __init__(
        self,
        link: Link,
        inlet: Inlet,
        topics: tuple[bytes, ...],
        read: Callable[[list[bytes]], T | None],
        timeout_s: float | None,
        begin: Callable[[list[bytes]], object],
    ) -> None:
        self._link = link
        self._inlet = inlet
        self._topics = topics
        self._read = read
        self._timeout_s = timeout_s
        self._begin = begin
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
            if frames[0] == STATUS:
                self._begin(frames)
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
        self._early = await self._link.first_status(self._inlet)
        check_types(self._topics, self._early[-1])
        self._has_joined = True
        if STATUS not in self._topics:
            self._inlet.unsubscribe(STATUS)

    async def _take(self) -> list[bytes] | None:
        if self._early:
            return self._early.popleft()
        return await self._inlet.next(None if self._timeout_s is None else time.monotonic() + self._timeout_s)
