"""What a station's users receive on 5556, put together again: PDU, type, and what the interface knew."""

from typing import NamedTuple

from board.errors import ProtocolError
from drivers.message import ITS_HEADER
from drivers.wire import raw


class Message(NamedTuple):
    """A PDU as the station gave it to its users; raw is None where its `raw.` message is missing.

    implausible  reasons to doubt it, as the station's report port has them.
    """

    type: str
    pdu: bytes
    raw: raw.RawRx | None
    implausible: tuple[str, ...] = ()

    @property
    def message_id(self) -> int | None:
        """messageID of the ITS PDU header; None where it is too short."""
        return self.pdu[1] if len(self.pdu) > 1 else None

    @property
    def station_id(self) -> int | None:
        """stationID of the ITS PDU header (TS 102 894-2, ItsPduHeader); None where it is too short."""
        return int.from_bytes(self.pdu[2:6]) if len(self.pdu) >= ITS_HEADER else None


class Pairing:
    """Joins the `raw.` and `v2x.<type>.` messages of 5556, which follow each other; rubbish is counted."""

    def __init__(self) -> None:
        self.rubbish = 0
        self.sample = b""
        self._raw: raw.RawRx | None = None

    def feed(self, frames: list[bytes]) -> Message | None:
        """Take one ZeroMQ message. Returns a Message for `v2x.<type>.`, None for the rest; never raises."""
        if len(frames) != 2:
            self._count(b"".join(frames))
            return None
        envelope, octets = frames
        if envelope.startswith(b"v2x.") and envelope.endswith(b".") and len(envelope) > 4:
            return self._join(envelope[4:-1].decode("ascii", "backslashreplace"), octets)
        if envelope == b"raw.":
            self._keep(octets)
        elif envelope != b"hb.counter":
            self._count(envelope)
        return None

    def _keep(self, octets: bytes) -> None:
        try:
            self._raw = raw.parse(octets)
        except ProtocolError:
            self._raw = None
            self._count(octets)

    def _join(self, kind: str, pdu: bytes) -> Message:
        kept, self._raw = self._raw, None
        return Message(kind, pdu, kept if kept is not None and kept.pdu == pdu else None)

    def _count(self, sample: bytes) -> None:
        self.rubbish += 1
        self.sample = sample[:32]
