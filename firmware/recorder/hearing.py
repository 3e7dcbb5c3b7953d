"""What a station tells a recorder, on one socket: who it is, what time it is, and each frame."""

import sys
import time
from collections.abc import Callable, Iterator
from typing import TypeAlias

import zmq

from board.errors import StationError
from firmware.recorder.told import Told, parse
from firmware.user import client

TURN_S = 0.2  # how often whoever records may look after its file while nothing comes
AT_ONCE = 512  # frames taken before it may

Status: TypeAlias = dict[str, object]


class Hearing:
    """Frames of one station, which may come and go.

    on_status  is told who it is: before the first frame, and each time that it is another one or was started again;
               empty where it does not say.
    on_time    has its time object, once a second.
    note       receives notes; None: standard error, as for the rest.
    private    ZeroMQ address of the report port for the station's own recorder; empty: TCP.
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
        self.on_status: Callable[[Status], None] = lambda status: None
        self.on_time: Callable[[Status], None] = lambda status: None
        self._subscriber = client.subscribe(context, place, place.report, "frame.", "time.", "status.", url=private)
        self._connections = self._subscriber.get_monitor_socket(zmq.EVENT_CONNECTED)
        self._is_status_wanted = True
        self.is_known = False  # who the station is, or that it does not say
        self._early: list[Told] = []  # before its status
        self._asked = self._heard = time.monotonic()
        self.is_heard = self._is_silent = False

    def frames(self, idle: Callable[[], bool]) -> Iterator[Told]:
        """As they come. idle is called between them and while there are none, a few times a second: False ends it.

        Raises StationError where what listens there is no station.
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
        elif topic == "time.":
            self.on_time(said)

    def _know(self, status: Status) -> None:
        self.on_status(status)
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
        """Another connection may be another station, or the same one that was started again."""
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
            say(
                f"the station is silent: nothing is recorded until {self.place.host}:{self.place.report} is heard again"
            )
            self._is_silent = True
        if self.is_known or time.monotonic() < self._asked + client.ANSWER_S:
            return
        if self.is_heard:
            self._know({})
        else:
            raise StationError(
                f"what listens at {self.place.host}:{self.place.report} says nothing",
                "is that a station's report port? name it with --report PORT",
            )


def say(text: str) -> None:
    """To whoever reads standard error, at once: programs wait for it."""
    print(f"captain: {text}", file=sys.stderr, flush=True)
