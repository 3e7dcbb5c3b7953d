"""Marks of implausible messages: reads them and joins them with messages."""

from collections import OrderedDict

from firmware.client import client
from firmware.client.received import Message

TOPIC = "implausible."
# A station sends a mark before its message, but over another connection, so that the mark may arrive later.
LATE_MS = 20
MOST = 1024  # limit of stored marks: some never match a message, for example those of duplicates.

Key = tuple[str, int]  # digest of the PDU, and received_ns in microseconds as in RawRxMessage


class Marks:
    """Marks of implausible messages of one station. Without its report port, no message has a mark.

    Only after the first mark does look() wait for late ones: most stations never send any.
    """

    def __init__(self, context: client.Context, place: client.Address) -> None:
        self._marks: OrderedDict[Key, tuple[str, ...]] = OrderedDict()
        # This connects in the background, so a missing report port does not delay messages.
        self._subscriber = client.subscribe(context, place, place.report, TOPIC, url=place.url(place.report))
        self._late_ms = 0

    def look(self) -> None:
        """Store the marks that have arrived."""
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
        """Return the message with its mark added, or unchanged if it has no mark."""
        if not self._marks or message.raw is None:
            return message
        from hashlib import sha256  # imported on demand, because it loads OpenSSL

        digest = sha256(message.pdu).hexdigest()[:16]
        found = self._marks.pop((digest, message.raw.received_ns // 1000), ())
        return message._replace(implausible=found) if found else message


def _mark(told: dict[str, object]) -> tuple[Key, tuple[str, ...]] | None:
    """Return key and reasons of an object of the topic; None if it is malformed."""
    digest, received_ns, reasons = (told.get(key) for key in ("digest", "received_ns", "implausible"))
    if not isinstance(digest, str) or not isinstance(received_ns, int) or not isinstance(reasons, list):
        return None
    return (digest, received_ns // 1000), tuple(str(one)[:32] for one in reasons[:8])
