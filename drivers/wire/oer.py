"""Just enough of OER (ITU-T X.696) to walk over a value whose type is known: where does it end?

A walk is a callable that takes octets and the place where a value begins and gives the place where it ends.
It may run past the last octet: an IndexError and an end beyond it both mean that the value is cut off.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from board.errors import ProtocolError

Walk = Callable[[bytes, int], int]


def length(octets: bytes, at: int) -> tuple[int, int]:
    """A length determinant (clause 8.6): the length, and where that which it counts begins."""
    first = octets[at]
    if first < 0x80:
        return first, at + 1
    end = at + 1 + (first & 0x7F)
    return int.from_bytes(octets[at + 1 : end]), end


def counted(octets: bytes, at: int) -> int:
    """Anything with its length in front: OCTET STRING, unbounded INTEGER, UTF8String, open type."""
    size, start = length(octets, at)
    return start + size


def content(octets: bytes, at: int) -> bytes:
    """The octets of anything with its length in front."""
    size, start = length(octets, at)
    return octets[start : start + size]


def fixed(size: int) -> Walk:
    """Anything of a known size: fixed strings, bounded INTEGERs, short ENUMERATED (1), NULL (0)."""
    return lambda _, at: at + size


def elements(element: Walk, octets: bytes, at: int) -> Iterator[int]:
    """Where each element of a SEQUENCE OF begins, and at last where the whole ends (clause 17)."""
    count = int.from_bytes(content(octets, at))
    if count > len(octets):  # each has an octet at least: a wrong count must not keep us busy
        raise ProtocolError(f"OER: {count} elements in {len(octets)} octets")
    at = counted(octets, at)
    for _ in range(count):
        yield at
        at = element(octets, at)
    yield at


def sequence_of(element: Walk) -> Walk:
    """SEQUENCE OF."""
    return lambda octets, at: deque(elements(element, octets, at), maxlen=1)[0]


def choice(*alternatives: Walk, extensible: bool = False) -> Walk:
    """CHOICE with automatic tags (clause 20): what is no root alternative is an open type, if extensible."""

    def walk(octets: bytes, at: int) -> int:
        tag = octets[at] - 0x80
        if 0 <= tag < len(alternatives):
            return alternatives[tag](octets, at + 1)
        if extensible and tag >= 0:
            return counted(octets, at + 1)
        raise ProtocolError(f"OER: no alternative has the tag {octets[at]:#04x}")

    return walk


class Field(NamedTuple):
    """A component of a SEQUENCE."""

    name: str
    walk: Walk
    is_optional: bool = False


class Sequence:
    """SEQUENCE (clause 16): a preamble of bits (additions follow? which optional ones are here?), components,
    additions as open types. places() tells where the components begin; called, it is a walk.
    """

    def __init__(self, *fields: Field, extensible: bool = False) -> None:
        self._fields = fields
        self._extensible = extensible
        bits = extensible + sum(field.is_optional for field in fields)
        self._preamble = (bits + 7) // 8  # octets

    def places(self, octets: bytes, at: int) -> Mapping[str, int]:
        """Where each component that is there begins, and as `end` where the whole ends."""
        start = at + self._preamble
        preamble = int.from_bytes(octets[at:start])
        bit = 1 << 8 * self._preamble - 1 if self._preamble else 0
        has_additions = self._extensible and bool(preamble & bit)
        if self._extensible:
            bit >>= 1
        at = start
        places = {}
        for name, walk, is_optional in self._fields:
            if is_optional:
                bit, here = bit >> 1, bit
                if not preamble & here:
                    continue
            places[name] = at
            at = walk(octets, at)
        places["end"] = _additions(octets, at) if has_additions else at
        return places

    def __call__(self, octets: bytes, at: int) -> int:
        return self.places(octets, at)["end"]


def _additions(octets: bytes, at: int) -> int:
    """A bit string of the additions that are there, its first octet the unused bits; then each of them."""
    present = content(octets, at)[1:]
    at = counted(octets, at)
    for _ in range(int.from_bytes(present).bit_count()):
        at = counted(octets, at)
    return at
