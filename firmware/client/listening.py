"""Received messages of a station, limited by type, station, count and duration: of port 5556 or 5558."""

import argparse
import time
from collections.abc import Callable, Iterator
from typing import Generic, NamedTuple, Protocol, TypeVar

import zmq

from board.runtime.errors import StationError
from firmware.client import client
from firmware.client.arguments import integer, message_type, seconds, times
from firmware.client.received import Heard

# Redrawing a table more often is not readable and costs processor time.
REDRAW_S = 0.5

HIGHEST_STATION_ID = 0xFFFFFFFF

M = TypeVar("M", bound=Heard)
M_co = TypeVar("M_co", bound=Heard, covariant=True)


class ListenFilter(NamedTuple):
    """Selection of messages, and when to end.

    types     message types by name or messageID; empty: all.
    stations  stationIDs; empty: all.
    most      end after this number of messages; None: no limit.
    for_s     end after this time in seconds; None: no limit.
    """

    types: frozenset[str | int] = frozenset()
    stations: frozenset[int] = frozenset()
    most: int | None = None
    for_s: float | None = None


def add_wish(parser: argparse.ArgumentParser) -> None:
    """Add the options that select messages; wish_of() reads their values."""
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
        help="only messages with this stationID; may be repeated",
    )
    parser.add_argument("--count", metavar="N", type=times, help="end after N messages")
    parser.add_argument("--duration", metavar="S", type=seconds, help="end after S seconds")


def wish_of(options: argparse.Namespace) -> ListenFilter:
    """Return the filter that the options of add_wish() give."""
    return ListenFilter(frozenset(options.type), frozenset(options.station_id), options.count, options.duration)


class Reader(Protocol[M_co]):
    """Reader of the messages of a port: Pairing of 5556, Delivered of 5558."""

    def feed(self, frames: list[bytes]) -> M_co | None:
        """Take one ZeroMQ message, and return a received message if this completes it."""


class Listening(Generic[M]):
    """Selected messages of one subscription to a station.

    messages() calls `idle` at least every REDRAW_S, so that a table can be redrawn while no message arrives.

    address   host and port of the subscription.
    on_heard  called at the first message of any kind, including heartbeats and statuses.
    """

    def __init__(self, subscriber: client.Socket, address: str, wish: ListenFilter, reader: Reader[M]) -> None:
        self.on_heard: Callable[[], None] = lambda: None
        self.address = address
        self.started = self.heard = time.monotonic()
        self._subscriber = subscriber
        self._reader = reader
        self._poller = zmq.Poller()
        self._poller.register(subscriber, zmq.POLLIN)
        self._typed: Callable[[], bool] | None = None
        self._wish = wish
        self._end = self.started + wish.for_s if wish.for_s is not None else None

    def watch(self, descriptor: int, typed: Callable[[], bool]) -> None:
        """Call typed() whenever the descriptor is readable; messages() ends once typed() returns False."""
        self._poller.register(descriptor, zmq.POLLIN)
        self._typed = typed

    def messages(self, idle: Callable[[], None]) -> Iterator[M]:
        """Yield the selected messages until a limit of the filter is reached.

        idle  called at least every REDRAW_S.

        Raises StationError if not even a heartbeat or a status arrives within client.ANSWER_S: no station publishes at
        the port.
        """
        count = 0
        wake = time.monotonic() + REDRAW_S
        while self._end is None or time.monotonic() < self._end:
            until = wake if self._end is None else min(wake, self._end)
            ready = self._poller.poll(max(0, round((until - time.monotonic()) * 1000)) + 1)
            if self._typed is not None and any(one is not self._subscriber for one, _ in ready) and not self._typed():
                return
            for frames in client.waiting(self._subscriber):
                if self.heard == self.started:
                    self.on_heard()
                self.heard = time.monotonic()
                message = self._reader.feed(frames)
                if message is None or not self._is_wanted(message):
                    continue
                yield message
                count += 1
                if count == self._wish.most:
                    return
            if time.monotonic() >= wake:
                self._check()
                idle()
                wake = time.monotonic() + REDRAW_S

    def _is_wanted(self, message: M) -> bool:
        types, stations = self._wish.types, self._wish.stations
        is_type = not types or not types.isdisjoint((message.type, *message.pdu[1:2]))  # octet 1 is the messageID
        return is_type and (not stations or message.station in stations)

    @property
    def silent_s(self) -> float:
        """Seconds since the last message, heartbeat or status; 0 while the station counts as present."""
        silent = time.monotonic() - self.heard
        return silent if silent > client.ANSWER_S else 0.0

    def _check(self) -> None:
        """Raise StationError if nothing was ever received.

        A station that fell silent later may return: ZeroMQ reconnects by itself.
        """
        if self.silent_s and self.heard == self.started:
            raise StationError(
                f"{self.address}: no heartbeat and no status within {client.ANSWER_S:g} s",
                f"{client.FIRST_PORT}, or its single port with --report PORT (`captain listen`) or --to-users PORT",
            )
