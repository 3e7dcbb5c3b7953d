"""Publications, deliveries and identity, shared by profiles and forms of payloads."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

from board.runtime.errors import ProtocolError
from drivers.message import Ego
from drivers.reason import Reason
from drivers.wire.type_tree import Type

MAX_PAYLOAD = 65536  # octets; a PDU of 1500 octets has 2000 as base64, and about 20,000 as JSON
MAX_SOURCE = 255  # octets of a source's name
MAX_WHY = 300  # characters; a list of known names may be long


class Publication(NamedTuple):
    """Message to publish at a broker.

    expiry_s  the broker deletes the message after this time (MQTT 5). None: after its lifetime, or never if retained.
    """

    topic: str
    payload: bytes
    qos: int
    retain: bool
    expiry_s: int | None


class Delivery(NamedTuple):
    """Message delivered by a broker.

    is_repeated  flag DUP: the message may have been delivered before.
    """

    topic: str
    payload: bytes
    is_retained: bool = False
    is_repeated: bool = False


class ReceivedPdu(NamedTuple):
    """PDU from a delivery.

    btp_port  port in the topic; None if the topic names none.
    source    name of the sending client, if the payload contains it; else empty. At most MAX_SOURCE octets of UTF-8.
    """

    pdu: bytes
    btp_port: int | None
    source: str


class Identity(NamedTuple):
    """Identity of the station at a broker.

    host     unique name at the broker.
    station  stationID of its messages.
    uuid     UUID of the station, in profiles that use one.
    prefix   first levels of topics, in profiles that leave them to the user.
    """

    host: str
    station: int
    uuid: str
    prefix: str


class RefusedError(ProtocolError):
    """Refusal of a delivery; its reason is counted."""

    def __init__(self, reason: Reason, message: str, hint: str = "") -> None:
        super().__init__(message if len(message) <= MAX_WHY else message[: MAX_WHY - 3] + "...", hint)
        self.reason = reason


class Edition(Protocol):
    """Message of one edition of its standard, in the message library.

    ids and versions are those of the ITS PDU header. encode() raises ValueError with path and cause for an invalid
    value.
    """

    @property
    def name(self) -> str: ...
    @property
    def ids(self) -> Sequence[int]: ...
    @property
    def versions(self) -> Sequence[int]: ...

    def encode(self, value: object, /) -> bytes: ...
    def type_tree(self) -> Type: ...


class Codec(Protocol):
    """Message library, for forms of payloads that need it."""

    def decodings(self, pdu: bytes) -> Iterator[tuple[Edition, dict[str, Any]]]:
        """Yield the editions that a PDU may have, likely ones first, with its value in each.

        Raises ValueError if no edition decodes it, or if several decode different values and the user has chosen none.
        """

    def editions(self, kind: str) -> Sequence[Edition]:
        """Return the editions of a type, by its name or messageID, the preferred one first; empty if unknown."""


def message_id(codec: Codec, edition: Edition, kind: str) -> int:
    """Return the messageID for a PDU of an edition: the one in the topic, if there is one.

    Otherwise it is the edition's first messageID that no other type has. For example, the first VAMs had 14, which is
    CPM's.

    kind  name of the type, or its messageID.
    """
    if kind.isdecimal() and int(kind) in edition.ids:
        return int(kind)
    names = {one.name for one in codec.editions(kind)}
    own = [number for number in edition.ids if names >= {one.name for one in codec.editions(str(number))}]
    return (own or edition.ids)[0]


class Sending(NamedTuple):
    """Content for a payload.

    kind    name of the type; its messageID for a type without name.
    now_ms  Unix time.
    """

    kind: str
    btp_port: int
    pdu: bytes
    own: Ego
    now_ms: int


class Payload(Protocol):
    """Form of payloads, independent of topics."""

    def write(self, sending: Sending) -> bytes:
        """Write a payload. Raises RequestError if the form cannot hold the message."""

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        """Return PDU and source. Raises RefusedError for an invalid payload.

        kind  type in the topic, or empty.
        """


def source_of(text: str) -> str:
    """Return the name that a peer gave itself, if it is printable and short enough; else empty."""
    return text if text.isprintable() and len(text.encode()) <= MAX_SOURCE else ""
