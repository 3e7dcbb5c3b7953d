"""Received messages: of port 5556, joined with their `raw.` messages, and of topic `message.` of port 5558."""

from typing import NamedTuple, Protocol, TypeAlias

from board.runtime.errors import ProtocolError, StationError
from captain_client import message
from captain_client.reception import Reception, Tally
from captain_client.reports import object_of
from captain_client.requests import STATUS
from drivers.message import ITS_HEADER
from drivers.wire import raw

Delivery: TypeAlias = message.Message


class Heard(Protocol):
    """Received message, of port 5556 or of captain_client."""

    @property
    def type(self) -> str: ...
    @property
    def pdu(self) -> bytes: ...
    @property
    def station(self) -> int | None: ...
    @property
    def rssi_dbm(self) -> int | None: ...
    @property
    def source(self) -> str: ...
    @property
    def implausible(self) -> tuple[str, ...]: ...


class Message(NamedTuple):
    """Received PDU with its type.

    raw  metadata from the `raw.` message; None if that is missing.
    """

    type: str
    pdu: bytes
    raw: raw.RawRx | None

    @property
    def message_id(self) -> int | None:
        """messageID of the ITS PDU header; None if the PDU is too short."""
        return self.pdu[1] if len(self.pdu) > 1 else None

    @property
    def station(self) -> int | None:
        """stationID of the ITS PDU header (TS 102 894-2, ItsPduHeader); None if the PDU is too short."""
        return int.from_bytes(self.pdu[2:6]) if len(self.pdu) >= ITS_HEADER else None

    @property
    def rssi_dbm(self) -> int | None:
        """Signal strength in dBm; None if unknown."""
        return None if self.raw is None else self.raw.rx.rssi_dbm

    @property
    def source(self) -> str:
        """MAC address of the sender; empty if unknown."""
        return "" if self.raw is None else self.raw.rx.sender

    @property
    def implausible(self) -> tuple[str, ...]:
        """Empty: port 5556 has no marks."""
        return ()


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


class Delivered:
    """Reader of the topics `message.<type>.` and `status.`.

    sample  first 32 octets of the last malformed report.
    """

    def __init__(self) -> None:
        self.sample = b""
        self._tally = Tally()
        self._reception = Reception(self._tally)

    @property
    def rubbish(self) -> int:
        """Number of malformed reports."""
        return self._tally.malformed

    @property
    def missed(self) -> int:
        """Number of missed messages of the subscribed types, by the station's numbers."""
        return self._tally.missed

    def feed(self, frames: list[bytes]) -> Delivery | None:
        """Take one ZeroMQ message. Return a Delivery for `message.<type>.`, None for all other messages.

        Raises StationError if a status shows a station without this topic.
        """
        if frames[0] == STATUS and object_of(frames) is not None:
            if not self._reception.begin(frames):
                raise StationError(
                    "the station is of an older release: it has no topic `message.`", "update it: `captain update`"
                )
            return None
        found = self._reception.read(frames)
        if found is None:
            self.sample = b"".join(frames)[:32]
        return found
