"""Outbox: queues from the radio's process to the station; urgent first, fair, bounded."""

from collections import deque
from collections.abc import Set
from threading import Condition

from drivers.wire import v2xcast as wire

DEPTH = 64  # messages per caster: 64 ms at 1000 messages a second, the most that a channel of 10 MHz carries

_MESSAGE_ID = 1  # offset of messageID in the ITS PDU header (TS 102 894-2, ItsPduHeader)


class Outbox:
    """Queues of messages to the station: one for reports, one for urgent PDUs, one for the PDUs of each caster.

    Reports (states, confirms, answers) leave first, then urgent PDUs. The casters then take turns, so a flood on one
    does not delay the others. A full queue of PDUs drops its oldest one. Any thread may call any method.

    casters  number of casters.
    urgent   messageIDs of urgent PDUs.
    """

    def __init__(self, casters: int, urgent: Set[int]) -> None:
        self._said: deque[bytes] = deque()  # reports; bounded, because each thread waits before its next report
        self._lanes: list[deque[bytes]] = [deque() for _ in range(casters + 1)]  # the last queue is the urgent one
        self._urgent = urgent
        self._turn = 0
        self._dropped = 0
        self._is_closed = False
        self._changed = Condition()

    def say(self, message: bytes) -> None:
        """Queue a report: a state, a confirm or an answer."""
        with self._changed:
            self._said.append(message)
            self._changed.notify()

    def beat(self) -> None:
        """Queue a heartbeat message, unless another report already waits and proves that the process runs."""
        with self._changed:
            if not self._said:
                self._said.append(wire.ALIVE_NOW)
                self._changed.notify()

    def put(self, caster: int, pdu: bytes, message: bytes) -> None:
        """Queue a received PDU.

        caster   index of the caster that received it.
        pdu      the PDU: its messageID decides whether it is urgent.
        message  message to the station that contains the PDU.
        """
        is_urgent = len(pdu) > _MESSAGE_ID and pdu[_MESSAGE_ID] in self._urgent
        lane = self._lanes[-1 if is_urgent else caster]
        with self._changed:
            if len(lane) >= DEPTH:
                lane.popleft()
                self._dropped += 1
            lane.append(message)
            self._changed.notify()

    def take(self) -> bytes | None:
        """Return the next message; wait until there is one. Return None after close()."""
        with self._changed:
            while not self._is_closed:
                queue = self._next()
                if queue is not None:
                    return queue.popleft()
                self._changed.wait()
        return None

    def take_dropped(self) -> int:
        """Return the number of received messages dropped since the last call."""
        with self._changed:
            dropped, self._dropped = self._dropped, 0
        return dropped

    def close(self) -> None:
        """Close the outbox: take() then returns None."""
        with self._changed:
            self._is_closed = True
            self._changed.notify_all()

    def _next(self) -> deque[bytes] | None:
        for queue in (self._said, self._lanes[-1]):
            if queue:
                return queue
        casters = len(self._lanes) - 1
        for step in range(casters):
            index = (self._turn + step) % casters
            if self._lanes[index]:
                self._turn = index + 1
                return self._lanes[index]
        return None
