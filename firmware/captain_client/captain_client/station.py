"""Station: blocking client for one program, without threads.

with Station() as box:
    box.send("cam", speed=13.9).confirmed()
    for message in box.listen("denm"):
        print(message.station, message.get("cause"))
"""

from collections import deque
from collections.abc import Callable, Mapping
from os import PathLike
from types import TracebackType
from typing import Any, Generic, TypeVar

import zmq

from captain_client import control
from captain_client.address import Address, parse
from captain_client.arguments import check_path, check_seconds, check_text
from captain_client.link import Link
from captain_client.message import Message
from captain_client.reception import Reception, Tally, check_types
from captain_client.reports import Frame, frame_of, object_of
from captain_client.requests import STATUS, Confirmed, Request, outgoing
from captain_client.sockets import ANSWER_S, CONFIRM_S, topics_of, topics_of_types

T = TypeVar("T")


class Station:
    """Connection to one station. Use it in one thread. It reconnects by itself when the station is restarted.

    address    `HOST`, `HOST:PORT`, `:PORT` or `[V6]:PORT` with the first of the station's four ports, or an Address;
               default: 127.0.0.1:5555.
    timeout_s  seconds to wait for the station, here and in send().
    control    path of the control socket, for trigger() and reload_policy(); empty: the default path.

    Raises UnreachableError if no station answers within timeout_s, and ValueError for an invalid argument.
    """

    def __init__(
        self, address: str | Address = "", *, timeout_s: float = ANSWER_S, control: str | PathLike[str] = ""
    ) -> None:
        self.address = address if isinstance(address, Address) else parse(address)
        check_seconds("timeout_s", timeout_s)
        self._control = check_path("control", control)
        self._tally = Tally()
        self._link = Link(self.address, timeout_s)

    def __enter__(self) -> "Station":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close all sockets. Requests that libzmq has not yet written are written first, within a second."""
        self._link.close()

    # -- sending

    def send(
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
        """Send a message: fields, a dict, or the octets of a PDU.

        kind     message type, such as `cam`; empty for octets and dicts with a header: the station reads their type.
        message  PDU in octets, or message as a dict; without it, the station sets `fields` in its example of the type.
        form     dialect of the dict: "plain" (SI units, the default) or "json" (integers of the standard).
        edition  edition of the message, such as `cam-1.4.1`; default: the preferred one of the type.
        options  options of one message: lifetime_s, interfaces, priority, ... (firmware/guide/endpoint.md).
        fields   values by short name, such as speed=13.9, or by path.

        Raises ValueError for invalid arguments, and UnreachableError if the station does not take the message
        within the timeout of the constructor. The station's own refusal is raised by confirmed().
        """
        return Sent(self._link, self._link.send(kind, outgoing(kind, message, form, edition, options, fields)))

    # -- receiving

    def listen(self, *types: str, timeout_s: float | None = None) -> "Subscription[Message]":
        """Return an iterator over received messages. The subscription has reached the station when it returns.

        types      message types, such as `cam`; default: all.
        timeout_s  end the iteration if no message arrives for this time in seconds; default: wait without limit.

        Raises UnreachableError like the constructor, and ValueError for an invalid argument or a type that the station
        does not know.
        """
        reception = Reception(self._tally)
        return self._subscription(topics_of_types("message", types), reception.read, timeout_s, reception.begin)

    def indications(self, *types: str, timeout_s: float | None = None) -> "Subscription[dict[str, Any]]":
        """Return an iterator over indications: the receptions of each interface, duplicates included.

        Raises UnreachableError like the constructor, and ValueError for an invalid argument.
        """
        return self._subscription(topics_of_types("indication", types), object_of, timeout_s)

    def confirms(self, *types: str, timeout_s: float | None = None) -> "Subscription[dict[str, Any]]":
        """Return an iterator over the confirms of all users' requests.

        Raises UnreachableError like the constructor, and ValueError for an invalid argument.
        """
        return self._subscription(topics_of_types("confirm", types), object_of, timeout_s)

    def frames(self, *interfaces: str, timeout_s: float | None = None) -> "Subscription[Frame]":
        """Return an iterator over frames that come and leave.

        Raises UnreachableError like the constructor, and ValueError for an invalid argument.
        """
        return self._subscription(topics_of("frame", interfaces), frame_of, timeout_s)

    def status(self) -> dict[str, Any]:
        """Return the station's status. Raises UnreachableError if none arrives within ANSWER_S."""
        return self._next(STATUS)

    def time(self) -> dict[str, Any]:
        """Return the next object of topic `time.`, which the station sends once a second.

        Raises UnreachableError if none arrives within ANSWER_S.
        """
        return self._next(b"time.")

    @property
    def missed(self) -> int:
        """Number of messages that all iterators of listen() have missed."""
        return self._tally.missed

    @property
    def malformed(self) -> int:
        """Number of malformed reports, which were skipped."""
        return self._tally.malformed

    # -- commands

    def trigger(self, text: str) -> None:
        """Tell the recorder to keep its recent recording. text: reason.

        Raises RefusedError if the station has no recorder, and StationError if it is not on this machine. Raises
        ValueError for another type of text.
        """
        check_text("text", text)
        control.ask(control.path_of(self.address, self._control), "record", text=text)

    def reload_policy(self) -> None:
        """Tell the station to read its policy again, from its configuration.

        Raises RefusedError if the configuration is invalid, and StationError if the station is not on this machine.
        """
        control.ask(control.path_of(self.address, self._control), "reload", control.RELOAD_S)

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

    def _next(self, topic: bytes) -> dict[str, Any]:
        with self._subscription((topic,), object_of, ANSWER_S) as reports:
            for report in reports:
                return report
        raise self._link.unreachable(self.address.report)


class Sent:
    """Message that was given to the station.

    label  label in its confirms.
    """

    def __init__(self, link: Link, request: Request) -> None:
        self.label = request.label
        self._link = link
        self._request = request

    def confirmed(self, timeout_s: float = CONFIRM_S) -> Confirmed:
        """Wait until each interface has confirmed the message. Return the interfaces that sent it.

        timeout_s  seconds; default: 15, because a message of values may wait 10 s for the station's encoder.

        Raises RefusedError if the station refused it or no interface sent it, and UnconfirmedError after timeout_s, or
        if the station was restarted or the client closed meanwhile. Raises ValueError for an invalid timeout_s.
        """
        check_seconds("timeout_s", timeout_s)
        self._link.wait_for(self._request, timeout_s)
        return self._request.outcome()


class Subscription(Generic[T]):
    """Iterator over the reports of some topics. Close it, or leave its `with` block, to end the subscription.

    The subscription has reached the station when the constructor returns.

    end        new socket of the link, subscribed to the topics and to a status.
    read       returns the object of a report; None for a malformed one, which is skipped.
    timeout_s  end the iteration if no report arrives for this time in seconds; None: no limit.
    begin      takes the status that proves the subscription.

    Raises UnreachableError like Station, and ValueError for a type that the station does not know. The iteration raises
    StationError after close().
    """

    def __init__(
        self,
        link: Link,
        end: "zmq.Socket[bytes]",
        topics: tuple[bytes, ...],
        read: Callable[[list[bytes]], T | None],
        timeout_s: float | None,
        begin: Callable[[list[bytes]], object],
    ) -> None:
        self._socket = end
        self._link = link
        self._topics = topics
        self._read = read
        self._timeout_s = timeout_s
        self._begin = begin
        self._early = deque(link.first_status(self._socket))
        check_types(topics, self._early[-1])
        if STATUS not in topics:
            self._socket.unsubscribe(STATUS)

    def __del__(self) -> None:
        self.close()  # `for message in box.listen()` leaves it to the collector

    def __iter__(self) -> "Subscription[T]":
        return self

    def __next__(self) -> T:
        while (frames := self._take()) is not None:
            if frames[0].startswith(self._topics) and (found := self._read(frames)) is not None:
                return found
            if frames[0] == STATUS:
                self._begin(frames)
        raise StopIteration

    def __enter__(self) -> "Subscription[T]":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the subscription."""
        self._socket.close()

    def _take(self) -> list[bytes] | None:
        return self._early.popleft() if self._early else self._link.receive(self._socket, self._timeout_s)
