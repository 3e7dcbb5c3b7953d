"""Walk over OER values (ITU-T X.696) of known types: finds their ends without decoding them.

A walk is a callable. It takes octets and the index where a value begins, and returns the index where the value ends.
It may run past the last octet: an IndexError and an end beyond the octets both mean that the value is truncated.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from board.runtime.errors import ProtocolError

Walk = Callable[[bytes, int], int]


def length(octets: bytes, at: int) -> tuple[int, int]:
    """Parse a length determinant (clause 8.6): return the length and the index of the octets that it counts."""
    first = octets[at]
    if first < 0x80:
        return first, at + 1
    end = at + 1 + (first & 0x7F)
    return int.from_bytes(octets[at + 1 : end]), end


def counted(octets: bytes, at: int) -> int:
    """Walk over a value with a length determinant: OCTET STRING, unbounded INTEGER, UTF8String, open type."""
    size, start = length(octets, at)
    return start + size


def content(octets: bytes, at: int) -> bytes:
    """Return the octets of a value with a length determinant."""
    size, start = length(octets, at)
    return octets[start : start + size]


def fixed(size: int) -> Walk:
    """Return the walk over a type of fixed size: fixed strings, bounded INTEGERs, short ENUMERATED (1), NULL (0)."""
    return lambda _, at: at + size


def elements(element: Walk, octets: bytes, at: int) -> Iterator[int]:
    """Yield the index of each element of a SEQUENCE OF, and at last the index of its end (clause 17).

    Raises ProtocolError for more elements than octets.
    """
    count = int.from_bytes(content(octets, at))
    if count > len(octets):  # an element has at least one octet; a wrong count must not cause a long loop
        raise ProtocolError(f"OER: {count} elements in {len(octets)} octets")
    at = counted(octets, at)
    for _ in range(count):
        yield at
        at = element(octets, at)
    yield at


def sequence_of(element: Walk) -> Walk:
    """Return the walk over a SEQUENCE OF."""
    return lambda octets, at: deque(elements(element, octets, at), maxlen=1)[0]


def choice(*alternatives: Walk, extensible: bool = False) -> Walk:
    """Return the walk over a CHOICE with automatic tags (clause 20).

    extensible  alternatives beyond those given are walked over as open types.
    """

    def walk(octets: bytes, at: int) -> int:
        tag = octets[at] - 0x80
        if 0 <= tag < len(alternatives):
            return alternatives[tag](octets, at + 1)
        if extensible and tag >= 0:
            return counted(octets, at + 1)
        raise ProtocolError(f"OER: no alternative has the tag {octets[at]:#04x}")

    return walk


class Field(NamedTuple):
    """Component of a SEQUENCE."""

    name: str
    walk: Walk
    is_optional: bool = False


class Sequence:
    """Walk over a SEQUENCE (clause 16): preamble, components, and additions as open types.

    The preamble has one bit for "has additions", if the type is extensible, and one bit per optional component.
    """

    def __init__(self, *fields: Field, extensible: bool = False) -> None:
        self._fields = fields
        self._extensible = extensible
        bits = extensible + sum(field.is_optional for field in fields)
        self._preamble = (bits + 7) // 8  # octets of the preamble

    def places(self, octets: bytes, at: int) -> Mapping[str, int]:
        """Return the index of each component that is present, by its name, and the index of the end as `end`."""
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
    """Walk over the extension additions: a bit string of those present, then each of them as an open type."""
    present = content(octets, at)[1:]
    at = counted(octets, at)
    for _ in range(int.from_bytes(present).bit_count()):
        at = counted(octets, at)
    return at
