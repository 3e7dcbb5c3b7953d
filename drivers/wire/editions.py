"""Editions that a PDU fits: by its ITS PDU header, and by the values that they read."""

from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar


class Readable(Protocol):
    """A message of one edition, in the message library. asn1/README.md describes leaves()."""

    @property
    def name(self) -> str: ...
    @property
    def type(self) -> str: ...
    @property
    def rank(self) -> int: ...
    @property
    def ids(self) -> Sequence[int]: ...
    @property
    def versions(self) -> Sequence[int]: ...

    def leaves(self, octets: bytes, /) -> tuple[bytes, int]: ...


One = TypeVar("One", bound=Readable)


def of_header(messages: Iterable[One], octets: bytes) -> list[One]:
    """Return those whose messageID and protocolVersion the header has."""
    if len(octets) < 2:
        return []
    version, number = octets[0], octets[1]
    return [one for one in messages if number in one.ids and version in one.versions]


def compared(messages: Sequence[One], octets: bytes) -> tuple[list[One], tuple[One, ...]]:
    """Order editions that give the same octets back, and return those that read other values than the first.

    messages  by preference.

    Of the first one's type, an edition that knows every part of the message comes before one that does not. One that
    knows less reads no other values: a sender of that edition could not have written those parts.
    """
    if len(messages) < 2:
        return list(messages), ()
    read = {one.name: leaves(one, octets) for one in messages}
    kind = messages[0].type
    ordered = sorted(messages, key=lambda one: (one.type != kind, read[one.name][1]))
    values, unknown = read[ordered[0].name]
    others = (
        one
        for one in ordered[1:]
        if read[one.name][0] != values and not (one.type == kind and read[one.name][1] > unknown)
    )
    return ordered, tuple(others)


def leaves(message: Readable, octets: bytes) -> tuple[bytes, int]:
    """Return the values without names and the number of unknown parts; those of no other edition where it cannot."""
    try:
        return message.leaves(octets)
    except (ValueError, MemoryError):
        return message.name.encode(), len(octets)


def names(messages: Iterable[Readable], word: str = "and") -> str:
    """Return their names for a sentence: "cam-1.4.1, cam-2.1.1 and cam-2.3.1"."""
    *most, last = [one.name for one in messages]
    return f"{', '.join(most)} {word} {last}" if most else last
