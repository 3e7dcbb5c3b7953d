"""Editions of a PDU: finds them by its ITS PDU header, and compares the values that they decode."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple, Protocol, TypeVar

# Edition names that captain.toml accepts. The list is here because the router checks them and must not load the
# message library; only workers load it.
NAMES = (
    "cam-1.3.2", "cam-1.4.1", "cam-2.1.1", "cam-2.3.1", "cam-2.3.1-ext", "cpm-2.1.1", "cpm-2.1.1-ext", "cpm-tr-2.1.1",
    "denm-1.2.2", "denm-1.3.1", "denm-2.2.1", "denm-2.2.1-ext", "denm-2.3.1", "denm-2.3.1-ext", "ev_rsr-1.1.1",
    "evcsn-1.1.1", "imzm-2.1.1", "ivim-2.1.1", "ivim-2.2.1", "ivim-2.2.1-ext", "mapem-2.1.1", "mcm-1", "poi-2.1.1",
    "poi-2.1.1-ext", "rtcmem-2.1.1", "spatem-2.1.1", "spatem-2.2.1", "srem-2.1.1", "ssem-2.1.1",
    "tistpgtransaction-1.1.1", "vam-1", "vam-2.1.1", "vam-2.3.1",
)  # fmt: skip


class Announced(Protocol):
    """Message of one edition, with the messageIDs (ids) and protocolVersions (versions) of its ITS PDU headers."""

    @property
    def ids(self) -> Sequence[int]: ...
    @property
    def versions(self) -> Sequence[int]: ...


class Readable(Announced, Protocol):
    """Message of one edition in the message library. asn1/guide/python-functions.md describes leaves()."""

    @property
    def name(self) -> str: ...
    @property
    def type(self) -> str: ...
    @property
    def rank(self) -> int: ...
    @property
    def form_of(self) -> str: ...

    def leaves(self, octets: bytes, /) -> tuple[bytes, int]: ...
    def validate(self, value: object, /) -> None: ...


class Leaves(NamedTuple):
    """Values that an edition decodes from a PDU.

    values   encoded values, without field names.
    unknown  number of parts that the edition does not know.
    is_read  False if the edition cannot decode the PDU; values then differ from those of every other edition.
    """

    values: bytes
    unknown: int
    is_read: bool = True


One = TypeVar("One", bound=Readable)
Known = TypeVar("Known", bound=Announced)


def of_header(messages: Iterable[Known], octets: bytes) -> list[Known]:
    """Return the messages that have the messageID and protocolVersion of the header of a PDU."""
    if len(octets) < 2:
        return []
    version, number = octets[0], octets[1]
    return [one for one in messages if number in one.ids and version in one.versions]


def compared(messages: Sequence[One], octets: bytes) -> tuple[list[One], tuple[One, ...]]:
    """Sort editions that re-encode a PDU to the same octets, and find those that decode other values than the first.

    messages  editions in order of preference.

    Returns all editions, best first, and those with other values. Editions of the same type as the first one come
    first; among them, the one that knows most parts of the message. An edition that knows fewer parts is not reported:
    its senders cannot encode those parts. Limit: if no edition knows every part, the one that knows most comes first,
    though the sender may have used another edition.
    """
    messages = _settled(messages, octets)
    if len(messages) < 2:
        return list(messages), ()
    read = {one.name: leaves(one, octets) for one in messages}
    kind = messages[0].type
    ordered = sorted(messages, key=lambda one: (one.type != kind, not read[one.name].is_read, read[one.name].unknown))
    first = read[ordered[0].name]
    others = [one for one in ordered[1:] if read[one.name].values != first.values]
    return ordered, tuple(one for one in others if one.type != kind or not _knows_less(read[one.name], first))


def _knows_less(one: Leaves, first: Leaves) -> bool:
    return one.is_read and one.unknown > first.unknown


def are_forms(one: Readable, other: Readable) -> bool:
    """Return True if both are forms of one message (for example cam-2.3.1 and cam-2.3.1-ext)."""
    return one.name != other.name and (one.form_of or one.name) == (other.form_of or other.name)


def _settled(messages: Sequence[One], octets: bytes) -> list[One]:
    """Sort the two forms of one message: a form whose constraints all hold comes first.

    If both forms decode the same values, only the first one remains.
    """
    left = list(messages)
    for one in messages:
        for after in [other for other in left[left.index(one) + 1 :] if are_forms(one, other)] if one in left else []:
            if leaves(one, octets) == leaves(after, octets):
                left.remove(after)
            elif not is_valid(one, octets) and is_valid(after, octets):
                left.remove(after)
                left.insert(left.index(one), after)
    return left


def is_valid(message: Readable, octets: bytes) -> bool:
    """Return True if the octets satisfy every constraint of the standard."""
    try:
        message.validate(octets)
    except (ValueError, MemoryError):
        return False
    return True


def leaves(message: Readable, octets: bytes) -> Leaves:
    try:
        return Leaves(*message.leaves(octets))
    except (ValueError, MemoryError):
        return Leaves(message.name.encode(), len(octets), is_read=False)


def names(messages: Iterable[Readable], word: str = "and") -> str:
    """Return the names of messages for a sentence: "cam-1.4.1, cam-2.1.1 and cam-2.3.1"."""
    *most, last = [one.name for one in messages]
    return f"{', '.join(most)} {word} {last}" if most else last
