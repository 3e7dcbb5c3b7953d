"""Reception of one subscription: messages of topic `message.`, and how many were missed."""

from captain_client.message import Message
from captain_client.reports import object_of


class Tally:
    """Counts of one client.

    missed     number of messages that its subscriptions have missed.
    malformed  number of malformed reports.
    """

    def __init__(self) -> None:
        self.missed = 0
        self.malformed = 0


class Sequences:
    """Last sequence number of each message type, which shows missed messages.

    The station counts the messages of a type from its start. It has delivered earlier messages before the subscription,
    so nothing is missed before the first message of a type. After a restart it counts from 1.
    """

    def __init__(self) -> None:
        self._run = ""
        self._is_first_run = True
        self._last: dict[str, int] = {}

    def missed(self, run: str, kind: str, sequence: int) -> int:
        """Return the number of messages of a type that were missed before this one."""
        if run != self._run:
            self._is_first_run = not self._run
            self._run = run
            self._last.clear()
        last = self._last.get(kind, sequence - 1 if self._is_first_run else 0)
        self._last[kind] = sequence
        return max(0, sequence - last - 1)


class Reception:
    """Reader of the messages of one subscription."""

    def __init__(self, tally: Tally) -> None:
        self._tally = tally
        self._sequences = Sequences()

    def read(self, frames: list[bytes]) -> Message | None:
        """Return the message of a report of topic `message.`; count a malformed one, and return None."""
        try:
            _, _, pdu = frames
            told = object_of(frames) or {}
            missed = self._sequences.missed(str(told["run"]), told["type"], int(told["sequence"]))
            message = Message(pdu, told, missed)
        except (KeyError, TypeError, ValueError, OverflowError):
            self._tally.malformed += 1
            return None
        self._tally.missed += missed
        return message
