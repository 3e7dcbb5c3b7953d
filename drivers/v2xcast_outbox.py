"""What waits in the radio's process for the station: fair, bounded, and urgent first."""

from collections import deque
from collections.abc import Set
from threading import Condition

from drivers.wire import v2xcast as wire

DEPTH = 64  # messages of one caster: 64 ms of 1000 a second, which is all that a channel of 10 MHz carries

_MESSAGE_ID = 1  # its place in the ITS PDU header (TS 102 894-2, ItsPduHeader)


class Outbox:
    """A queue for what the process has to say, one for urgent messages, and one per caster.

    The first is emptied first, then the second; the casters have their turn one after the other, so that a flood in
    one takes nothing from the others. Of a queue that is full the oldest goes. All methods are for any thread.

    urgent  messageIDs of what is urgent.
    """

    def __init__(self, casters: int, urgent: Set[int]) -> None:
        self._said: deque[bytes] = deque()  # as long as the callers are bounded: each waits before it says more
        self._lanes: list[deque[bytes]] = [deque() for _ in range(casters + 1)]  # the urgent one is the last
        self._urgent = urgent
        self._turn = 0
        self._dropped = 0
        self._is_closed = False
        self._changed = Condition()

    def say(self, message: bytes) -> None:
        """Queue a state, a confirm or an answer."""
        with self._changed:
            self._said.append(message)
            self._changed.notify()

    def beat(self) -> None:
        """Say that the process is alive, unless what waits to be said shows it."""
        with self._changed:
            if not self._said:
                self._said.append(wire.ALIVE_NOW)
                self._changed.notify()

    def put(self, caster: int, pdu: bytes, message: bytes) -> None:
        """Queue a message that holds a received PDU."""
        is_urgent = len(pdu) > _MESSAGE_ID and pdu[_MESSAGE_ID] in self._urgent
        lane = self._lanes[-1 if is_urgent else caster]
        with self._changed:
            if len(lane) >= DEPTH:
                lane.popleft()
                self._dropped += 1
            lane.append(message)
            self._changed.notify()

    def take(self) -> bytes | None:
        """What goes next, as soon as there is something; None when it was closed."""
        with self._changed:
            while not self._is_closed:
                queue = self._next()
                if queue is not None:
                    return queue.popleft()
                self._changed.wait()
        return None

    def take_dropped(self) -> int:
        """How many received messages were dropped since the last time."""
        with self._changed:
            dropped, self._dropped = self._dropped, 0
        return dropped

    def close(self) -> None:
        """Nothing is taken any more."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    def _next(self) -> deque[bytes] | None:
        for queue in (self._said, self._lanes[-1]):
            if queue:
                return queue
        casters = len(self._lanes) - 1
        for step in range(casters):
            place = (self._turn + step) % casters
            if self._lanes[place]:
                self._turn = place + 1
                return self._lanes[place]
        return None
