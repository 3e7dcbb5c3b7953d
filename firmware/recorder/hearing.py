"""Reports that a recorder receives from a station: status, time and frames on one socket."""

import sys
import time
from collections.abc import Callable, Iterator
from typing import Protocol, TypeAlias

import zmq

from board.runtime.errors import StationError
from firmware.client import client
from firmware.printable import folded
from firmware.recorder.reported_frame import ReportedFrame, parse

TURN_S = 0.2  # seconds between calls of idle() while no frame comes
AT_ONCE = 512  # frames between two calls of idle() at most

Status: TypeAlias = dict[str, object]


class StationSink(Protocol):
    """Receiver of a station's status and time."""

    def take_status(self, status: Status) -> None:
        """Take the status: before the first frame, and after each change or restart of the station.

        {}: status unknown.
        """

    def time(self, status: Status) -> None:
        """Take the report of the station's time, once a second."""


class Hearing:
    """Frames reported by one station, which may stop and restart.

    sink     receives the station's status and time; None: both are ignored.
    note     prints notes; None: standard error, where warnings always go.
    private  ZeroMQ address of the report port for the station's own recorder; empty: TCP.
    """

    def __init__(
        self,
        context: client.Context,
        place: client.Address,
        note: Callable[[str], None] | None = None,
        private: str = "",
    ) -> None:
        self.place = place
        self._note = note or say
        self.sink: StationSink | None = None
        self._subscriber = client.subscribe(context, place, place.report, "frame.", "time.", "status.", url=private)
        self._connections = self._subscriber.get_monitor_socket(zmq.EVENT_CONNECTED)
        self._is_status_wanted = True
        self.is_known = False  # the status has arrived, or the station sends none
        self._early: list[ReportedFrame] = []  # frames received before the status
        self._asked = self._heard = time.monotonic()
        self.is_heard = self._is_silent = False

    def frames(self, idle: Callable[[], bool]) -> Iterator[ReportedFrame]:
        """Yield frames as they arrive.

        idle  called after each batch of frames and at least every TURN_S; returning False ends the iteration.

        Raises StationError if no report arrives within client.ANSWER_S: the port does not belong to a station.
        """
        while idle():
            self._subscriber.poll(round(TURN_S * 1000))
            self._look()
            for frames in client.waiting(self._subscriber, AT_ONCE):
                self._heard_now()
                topic = frames[0]
                if topic.startswith(b"frame."):
                    told = parse(frames)
                    if told is not None:
                        self._early.append(told)
                elif (report := client.parse_report(frames)) is not None:
                    self._take(*report)
                if len(self._early) > AT_ONCE:
                    self._know({})
                if self.is_known:
                    early, self._early = self._early, []
                    yield from early
            self._check()

    def _take(self, topic: str, said: Status) -> None:
        if topic == "status.":
            self._want_status(False)
            self._know(said)
        elif topic == "time." and self.sink is not None:
            self.sink.time(said)

    def _know(self, status: Status) -> None:
        if self.sink is not None:
            self.sink.take_status(status)
        self.is_known = True

    def _heard_now(self) -> None:
        now = time.monotonic()
        if not self.is_heard:
            self._note(f"a station is heard at {self.place.host}:{self.place.report}")
            self.is_heard = True
        elif self._is_silent:
            self._note(f"the station is heard again, after {now - self._heard:.1f} s")
            self._is_silent = False
        self._heard = now

    def _look(self) -> None:
        """Subscribe to the status again after a reconnection: the station may have restarted or be another one."""
        while self._connections.poll(0):
            self._connections.recv_multipart()
            self.is_known = False
            self._asked = time.monotonic()
            self._want_status(True)

    def _want_status(self, is_wanted: bool) -> None:
        if is_wanted is not self._is_status_wanted:
            self._is_status_wanted = is_wanted
            self._subscriber.setsockopt(zmq.SUBSCRIBE if is_wanted else zmq.UNSUBSCRIBE, b"status.")

    def _check(self) -> None:
        if self.is_heard and not self._is_silent and time.monotonic() > self._heard + client.ANSWER_S:
            where = f"{self.place.host}:{self.place.report}"
            say(f"{where}: the station is silent; recording continues when it is heard again")
            self._is_silent = True
        if self.is_known or time.monotonic() < self._asked + client.ANSWER_S:
            return
        if self.is_heard:
            self._know({})
        else:
            raise StationError(
                f"{self.place.host}:{self.place.report}: no report from this port",
                "name the report port of a station: --report PORT",
            )


def say(text: str) -> None:
    """Print a note to standard error at once, unbuffered: other programs wait for it."""
    print(folded(f"captain: {text}", sys.stderr), file=sys.stderr, flush=True)
