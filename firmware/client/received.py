"""Received message of port 5556: joins PDU and type with the metadata of its `raw.` message."""

from typing import NamedTuple

from board.runtime.errors import ProtocolError
from drivers.message import ITS_HEADER
from drivers.wire import raw


class Message(NamedTuple):
    """Received PDU with its type.

    raw          metadata from the `raw.` message; None if that is missing.
    implausible  reasons why the station marks it as implausible, from the report port; usually empty.
    """

    type: str
    pdu: bytes
    raw: raw.RawRx | None
    implausible: tuple[str, ...] = ()

    @property
    def message_id(self) -> int | None:
        """messageID of the ITS PDU header; None if the PDU is too short."""
        return self.pdu[1] if len(self.pdu) > 1 else None

    @property
    def station_id(self) -> int | None:
        """stationID of the ITS PDU header (TS 102 894-2, ItsPduHeader); None if the PDU is too short."""
        return int.from_bytes(self.pdu[2:6]) if len(self.pdu) >= ITS_HEADER else None


class Pairing:
    """Joins the messages `raw.` and `v2x.<type>.` of port 5556, which follow one another. Counts malformed messages.

    rubbish  number of malformed messages.
    sample   first 32 octets of the last malformed message.
    """

    def __init__(self) -> None:
        self.rubbish = 0
        self.sample = b""
        self._raw: raw.RawRx | None = None

    def feed(self, frames: list[bytes]) -> Message | None:
        """Take one ZeroMQ message. Return a Message for `v2x.<type>.`, None for all other messages; never raise."""
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
