"""Marks of implausible messages: they come by the report port, the messages by another."""

from collections import OrderedDict

from firmware.user import client
from firmware.user.received import Message

TOPIC = "implausible."
LATE_MS = 20  # a station tells of a mark before its message; two connections may swap them
MOST = 1024  # marks of messages that never come, such as duplicates

Key = tuple[str, int]  # digest of the PDU, and received_ns in microseconds as RawRxMessage has it


class Marks:
    """Takes the marks of one station; without its report port there are none.

    Waits for late marks only after a first one: most stations never send any.
    """

    def __init__(self, context: client.Context, place: client.Address) -> None:
        self._marks: OrderedDict[Key, tuple[str, ...]] = OrderedDict()
        # Connected in the background: without the report port, messages come as fast as with it.
        self._subscriber = client.subscribe(context, place, place.report, TOPIC, url=place.url(place.report))
        self._late_ms = 0

    def look(self) -> None:
        """Take the marks of the messages that have just come."""
        if not self._subscriber.poll(self._late_ms):
            return
        for frames in client.waiting(self._subscriber):
            told = client.parse_report(frames)
            if told is not None and (mark := _mark(told[1])) is not None:
                self._marks[mark[0]] = mark[1]
                self._late_ms = LATE_MS
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
