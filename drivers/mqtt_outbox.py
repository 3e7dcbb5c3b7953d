"""What the process with the MQTT client has to say: received messages wait while the station is busy, and not for ever.

The oldest goes first; of those that are urgent, none as long as there is another.
"""

import socket
from collections import deque
from collections.abc import Callable, Set

from drivers.wire import v2n_talk as talk

DEPTH = 512  # received messages: a tenth of a second of a burst of 5000 a second

# States, drops, details and signs of life. Answers are no more than the station has asked for.
MOST_SAID = 64

_MESSAGE_ID = 1  # its place in the ITS PDU header (TS 102 894-2, ItsPduHeader)


class Outbox:
    """In front of the channel to the station.

    urgent   messageIDs.
    dropped  called with the PDU of a message that had to make room.
    """

    def __init__(self, channel: socket.socket, urgent: Set[int], dropped: Callable[[bytes], None]) -> None:
        self._channel = channel
        self._urgent = urgent
        self._dropped = dropped
        self._said: deque[bytes] = deque()
        self._urgent_received: deque[bytes] = deque()
        self._received: deque[bytes] = deque()

    @property
    def is_waiting(self) -> bool:
        """Whether flush() has something to do."""
        return bool(self._said or self._urgent_received or self._received)

    def say(self, message: bytes) -> bool:
        """Send it, or keep it until the station has read what is in front of it. False: neither, too much waits."""
        if not self.is_waiting and self._send(message):
            return True
        if message[0] == talk.RECEIVED:
            self._keep(message)
        elif message[0] == talk.SENT or len(self._said) < MOST_SAID:
            self._said.append(message)
        else:
            return False
        return True

    def flush(self) -> None:
        """Send what waits, as much as the station takes."""
        for queue in (self._said, self._urgent_received, self._received):
            while queue:
                if not self._send(queue[0]):
                    return
                queue.popleft()

    def _send(self, message: bytes) -> bool:
        try:
            self._channel.send(message, socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except (BrokenPipeError, ConnectionResetError):
            pass  # the station has closed its end: who reads from it sees that
        return True

    def _keep(self, message: bytes) -> None:
        is_urgent = _pdu(message)[_MESSAGE_ID] in self._urgent
        (self._urgent_received if is_urgent else self._received).append(message)
        if len(self._received) + len(self._urgent_received) > DEPTH:
            oldest = (self._received or self._urgent_received).popleft()
            self._dropped(_pdu(oldest))


def _pdu(message: bytes) -> bytes:
    """Of a RECEIVED message."""
    _, found = talk.parse_received(message)
    return found.pdu
