"""What goes to a broker and comes from it, and who says so: shared by profiles and their payloads."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple, Protocol

from board.errors import ProtocolError
from drivers.message import Ego
from drivers.reason import Reason
from drivers.wire.v2n_type import Type

MAX_PAYLOAD = 65536  # octets; a PDU of 1500 is 2000 as base64, and some 20,000 as JSON
MAX_SOURCE = 255  # octets
MAX_WHY = 300  # characters: a list of all that would be known may be long


class Publication(NamedTuple):
    """What is published.

    expiry_s  after which the broker forgets it (MQTT 5); None: after its lifetime, or never if it is retained.
    """

    topic: str
    payload: bytes
    qos: int
    retain: bool
    expiry_s: int | None


class Delivery(NamedTuple):
    """What a broker delivered."""

    topic: str
    payload: bytes
    is_retained: bool = False


class Received(NamedTuple):
    """A PDU out of a delivery.

    btp_port  of the topic; None where that names none.
    source    the client that sent it, where the payload carries it; else empty. At most MAX_SOURCE octets of UTF-8.
    """

    pdu: bytes
    btp_port: int | None
    source: str


class Identity(NamedTuple):
    """Who the station is to a broker.

    host     its name there, unique.
    station  stationID of its messages.
    uuid     its name in profiles that want one.
    prefix   where topics begin, in profiles that leave that open.
    """

    host: str
    station: int
    uuid: str
    prefix: str


class RefusedError(ProtocolError):
    """What a broker delivered is not passed on, for a reason that is counted."""

    def __init__(self, reason: Reason, message: str, hint: str = "") -> None:
        super().__init__(message if len(message) <= MAX_WHY else message[: MAX_WHY - 3] + "...", hint)
        self.reason = reason


class Edition(Protocol):
    """A message of one edition of its standard, in the message library.

    ids and versions are of the ITS PDU header. What encode() cannot do is a ValueError that names path and reason.
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
    """The message library, where a payload needs it."""

    def decodings(self, pdu: bytes) -> Iterator[tuple[Edition, dict[str, Any]]]:
        """The editions that a PDU can be of, likely ones first, and its value in each.

        Raises ValueError for none, and for several that decode to different values, unless the user has chosen one.
        """

    def editions(self, kind: str) -> Sequence[Edition]:
        """Those of a type, by its name or messageID, the preferred one first; none where it is not known."""


def message_id(codec: Codec, edition: Edition, kind: str) -> int:
    """That of the topic; else the edition's first one that no other type has: 14 of the first VAMs is CPM's.

    kind  name of the type, or its messageID.
    """
    if kind.isdecimal() and int(kind) in edition.ids:
        return int(kind)
    names = {one.name for one in codec.editions(kind)}
    own = [number for number in edition.ids if names >= {one.name for one in codec.editions(str(number))}]
    return (own or edition.ids)[0]


class Sending(NamedTuple):
    """What a payload is made of.

    kind    name of the type; its messageID where it has none.
    now_ms  Unix time.
    """

    kind: str
    btp_port: int
    pdu: bytes
    own: Ego
    now_ms: int


class Payload(Protocol):
    """A form of payloads. Knows no topic."""

    def write(self, sending: Sending) -> bytes:
        """Raises RequestError where the form cannot hold the message."""

    def read(self, kind: str, payload: bytes) -> tuple[bytes, str]:
        """PDU and source; kind is the type that the topic names, or empty. Raises RefusedError."""


def source_of(text: str) -> str:
    """A name that a peer gave itself, if it is fit to be shown; else nothing."""
    return text if text.isprintable() and len(text.encode()) <= MAX_SOURCE else ""
