"""Messages to users on port 5556: all, or the first of each second.

The delay until port 5556 is measured. Topic `message.` of port 5558 has another delay, and a limit per second.
"""

import time
from collections.abc import Iterator

import zmq

from firmware.client import client
from firmware.client.received import Message, Pairing

# Messages read per second: all of a quiet channel. Each message costs the station another copy, and this program time.
GLANCE = 100
HEARTBEAT, ALL = "hb.counter", ""


class Tap:
    """User of a station that reads its messages.

    is_whole  read every message, at any cost.
    has_beat  something was received, so the port is that of a station's users.
    count     number of messages read.
    is_part   some messages may not have been read.
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
        """Yield the messages that have arrived, each with its monotonic time in ns.

        now_s is the time of a clock that never steps.
        """
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
