"""Outbox: bounded queues from the MQTT process to the station.

If too many received messages wait, the oldest one is dropped; an urgent one only if no other waits.
"""

import socket
from collections import deque
from collections.abc import Callable, Set

from drivers.wire.v2n import talk

DEPTH = 512  # most received messages that wait: a tenth of a second of a burst of 5000 a second

# Most waiting reports: states, drops, details and signs of life. Answers are not limited, because their number is
# limited by the station's requests.
MOST_SAID = 64

_MESSAGE_ID = 1  # offset of messageID in the ITS PDU header (TS 102 894-2, ItsPduHeader)


class Outbox:
    """Queues before the channel to the station: reports, urgent and other received messages, sent in this order.

    urgent   messageIDs of urgent messages.
    dropped  called with the PDU of each dropped message.
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
        """Whether messages wait for flush()."""
        return bool(self._said or self._urgent_received or self._received)

    def say(self, message: bytes) -> bool:
        """Send a message, or queue it if others wait; return False if it is a report and too many wait already."""
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
        """Send waiting messages until the channel is full."""
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
            pass  # the station has closed its end, which Process._read() notices
        return True

    def _keep(self, message: bytes) -> None:
        is_urgent = _pdu(message)[_MESSAGE_ID] in self._urgent
        (self._urgent_received if is_urgent else self._received).append(message)
        if len(self._received) + len(self._urgent_received) > DEPTH:
            oldest = (self._received or self._urgent_received).popleft()
            self._dropped(_pdu(oldest))


def _pdu(message: bytes) -> bytes:
    """Return the PDU in a RECEIVED message."""
    _, found = talk.parse_received(message)
    return found.pdu
