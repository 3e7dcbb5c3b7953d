"""What a station's users receive, until a count, a duration, or a station that is not there."""

import argparse
import time
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from board.errors import StationError
from firmware.user import client
from firmware.user.arguments import integer, message_type, seconds, times
from firmware.user.marks import Marks
from firmware.user.received import Message, Pairing

# A glance at a table tells no more; each costs the drawing of it.
REDRAW_S = 0.5

HIGHEST_STATION_ID = 0xFFFFFFFF


class Wish(NamedTuple):
    """Which messages, and how many.

    types    their names or messageIDs; all when empty.
    stations  their stationIDs; all when empty.
    most     end after so many.
    for_s    end after so many seconds.
    """

    types: frozenset[str | int] = frozenset()
    stations: frozenset[int] = frozenset()
    most: int | None = None
    for_s: float | None = None


def add_wish(parser: argparse.ArgumentParser) -> None:
    """The options by which a command is told which messages; wish_of() reads them."""
    parser.add_argument(
        "--type",
        metavar="T",
        action="append",
        type=message_type,
        default=[],
        help="only this type (cam, denm, ...), or this messageID (200); may be repeated",
    )
    parser.add_argument(
        "--station-id",
        metavar="N",
        action="append",
        type=integer(0, HIGHEST_STATION_ID),
        default=[],
        help="only what this station made; may be repeated",
    )
    parser.add_argument("--count", metavar="N", type=times, help="end after so many messages")
    parser.add_argument("--duration", metavar="S", type=seconds, help="end after so many seconds")


def wish_of(options: argparse.Namespace) -> Wish:
    """What the options of add_wish() ask for."""
    return Wish(frozenset(options.type), frozenset(options.station_id), options.count, options.duration)


class Listening:
    """Messages of one subscription.

    messages() calls `idle` at least every REDRAW_S, so that a table can be drawn while nothing comes.

    on_heard  is told of the first message of any kind, a heartbeat among them.
    marks     of messages that are implausible; None: they are not marked.
    """

    def __init__(
        self, subscriber: client.Socket, place: client.Address, wish: Wish, marks: Marks | None = None
    ) -> None:
        self._marks = marks
        self.pairing = Pairing()
        self.on_heard: Callable[[], None] = lambda: None
        self.place = place
        self.started = self.heard = time.monotonic()
        self._subscriber = subscriber
        self._wish = wish
        self._end = self.started + wish.for_s if wish.for_s is not None else None

    def messages(self, idle: Callable[[], None]) -> Iterator[Message]:
        count = 0
        wake = time.monotonic() + REDRAW_S
        while self._end is None or time.monotonic() < self._end:
            until = wake if self._end is None else min(wake, self._end)
            self._subscriber.poll(max(0, round((until - time.monotonic()) * 1000)) + 1)
            for frames in self._waiting():
                if self.heard == self.started:
                    self.on_heard()
                self.heard = time.monotonic()
                message = self.pairing.feed(frames)
                if message is None or not self._is_wanted(message):
                    continue
                yield message if self._marks is None else self._marks.marked(message)
                count += 1
                if count == self._wish.most:
                    return
            if time.monotonic() >= wake:
                self._check()
                idle()
                wake = time.monotonic() + REDRAW_S

    def _waiting(self) -> Iterable[list[bytes]]:
        """What has come, and what the station says of it."""
        if self._marks is None:
            return client.waiting(self._subscriber)
        frames = list(client.waiting(self._subscriber))
        if any(one[0].startswith(b"v2x.") for one in frames):
            self._marks.look()
        return frames

    def _is_wanted(self, message: Message) -> bool:
        types, stations = self._wish.types, self._wish.stations
        is_type = not types or not types.isdisjoint((message.type, message.message_id))
        return is_type and (not stations or message.station_id in stations)

    @property
    def silent_s(self) -> float:
        """Seconds without even a heartbeat; 0 while the station is there."""
        silent = time.monotonic() - self.heard
        return silent if silent > client.ANSWER_S else 0.0

    def _check(self) -> None:
        """What never said anything is no station; one that fell silent may come back: ZeroMQ reconnects."""
        if self.silent_s and self.heard == self.started:
            raise StationError(
                f"what listens at {self.place.host}:{self.place.to_users} sends no heartbeat",
                "is that where a station's users subscribe? name the port with --to-users PORT",
            )
