"""Marks of implausible messages: they come by the report port, the messages by another."""

from collections import OrderedDict

from board.errors import StationError
from firmware.user import client
from firmware.user.received import Message

TOPIC = "implausible."
LATE_MS = 20  # a station tells of a mark before its message; two connections may swap them
MOST = 1024  # marks of messages that never come, such as duplicates
REACH_S = 0.5

Key = tuple[str, int]  # digest of the PDU, and received_ns in microseconds as RawRxMessage has it


class Doubts:
    """Takes the marks of one station; without its report port there are none."""

    def __init__(self, context: client.Context, place: client.Address) -> None:
        self._marks: OrderedDict[Key, tuple[str, ...]] = OrderedDict()
        self._subscriber: client.Socket | None = None
        try:
            client.reach(place.host, place.report, REACH_S)
            self._subscriber = client.subscribe(context, place, place.report, TOPIC)
        except StationError:
            return

    def look(self) -> None:
        """Take the marks of the messages that have just come."""
        if self._subscriber is None or not self._subscriber.poll(LATE_MS):
            return
        for frames in client.waiting(self._subscriber):
            told = client.parse_report(frames)
            if told is not None and (mark := _mark(told[1])) is not None:
                self._marks[mark[0]] = mark[1]
        while len(self._marks) > MOST:
            self._marks.popitem(last=False)

    def marked(self, message: Message) -> Message:
        """The same with its mark, if it has one."""
        if not self._marks or message.raw is None:
            return message
        from hashlib import sha256  # with OpenSSL, which few need

        digest = sha256(message.pdu).hexdigest()[:16]
        found = self._marks.pop((digest, message.raw.received_ns // 1000), ())
        return message._replace(implausible=found) if found else message


def _mark(told: dict[str, object]) -> tuple[Key, tuple[str, ...]] | None:
    """Of an object of the topic; None for rubbish."""
    digest, received_ns, reasons = (told.get(key) for key in ("digest", "received_ns", "implausible"))
    if not isinstance(digest, str) or not isinstance(received_ns, int) or not isinstance(reasons, list):
        return None
    return (digest, received_ns // 1000), tuple(str(one)[:32] for one in reasons[:8])
