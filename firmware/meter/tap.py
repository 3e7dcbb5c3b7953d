"""What a station gives to its users on 5556: all of it, or of a busy one the first messages of each second."""

import time
from collections.abc import Iterator

import zmq

from firmware.user import client
from firmware.user.received import Message, Pairing

# Messages of a second: all of a quiet channel. Each costs the station another copy, and this program its reading.
GLANCE = 100
HEARTBEAT, ALL = "hb.counter", ""


class Tap:
    """A user of a station.

    is_whole  every message is looked at, whatever it costs.
    has_beat  something has come: these are a station's users.
    count     of messages that were looked at; is_part: there may have been more.
    """

    def __init__(self, context: client.Context, place: client.Address, is_whole: bool) -> None:
        self.socket = client.subscribe(context, place, place.to_users, HEARTBEAT, ALL)
        self.has_beat = self.is_part = False
        self.count = 0
        self._is_whole = is_whole
        self._pairing = Pairing()
        self._second = 0
        self._left = GLANCE

    def take(self, now_s: float) -> Iterator[tuple[Message, int]]:
        """What has come, and when it was here (monotonic ns); now_s is of a clock that never steps."""
        if int(now_s) != self._second:
            self._second = int(now_s)
            self._open()
        for frames in client.waiting(self.socket):
            now_ns = time.monotonic_ns()
            self.has_beat = True
            if (message := self._pairing.feed(frames)) is not None and self._left > 0:
                self.count += 1
                self._spend()
                yield message, now_ns

    def _open(self) -> None:
        if self._left <= 0:
            self.socket.setsockopt(zmq.SUBSCRIBE, ALL.encode())
        self._left = GLANCE

    def _spend(self) -> None:
        if self._is_whole:
            return
        self._left -= 1
        if self._left <= 0:
            self.is_part = True
            self.socket.setsockopt(zmq.UNSUBSCRIBE, ALL.encode())
