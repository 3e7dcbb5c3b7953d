"""Bits of UPER and what has no components, one function per clause of X.691 (02/2021). See reference.py."""

from collections.abc import Callable, Sequence
from typing import Any, Final

from asn1.model import types as t
from tests.asn1.ranges import Allowed, Union, alphabet, sizes

K64 = 65536
K16 = 16384

# X.680 41, X.691 30.1: the code points of the types whose characters all take the same number of bits.
KNOWN_MULTIPLIER: Final[dict[str, Union]] = {
    "NumericString": ((32, 32), (48, 57)),
    "PrintableString": ((32, 32), (39, 41), (43, 58), (61, 61), (63, 63), (65, 90), (97, 122)),
    "VisibleString": ((32, 126),),
    "ISO646String": ((32, 126),),
    "IA5String": ((0, 127),),
}


class Bits:
    """A string of bits that grows at its end."""

    __slots__ = ("count", "value")

    def __init__(self) -> None:
        self.value = 0
        self.count = 0

    def put(self, number: int, width: int) -> None:
        assert 0 <= number < 1 << width, f"{number} does not fit {width} bits"
        self.value = self.value << width | number
        self.count += width

    def put_all(self, octets: bytes) -> None:
        self.put(int.from_bytes(octets, "big"), 8 * len(octets))

    def octets(self) -> bytes:
        """11.1: filled up with zeros; nothing at all is one zero octet."""
        size = max(1, -(-self.count // 8))
        return (self.value << (8 * size - self.count)).to_bytes(size, "big")


Encode = Callable[[Bits, Any], None]

# ---------------------------------------------------------------- 11: whole numbers, lengths, open types


def small(bits: Bits, number: int) -> None:
    """11.6: normally small."""
    if number < 64:
        bits.put(number, 7)
    else:
        bits.put(1, 1)
        octets = number.to_bytes((number.bit_length() + 7) // 8, "big")
        general(bits, octets)


def small_length(bits: Bits, number: int) -> None:
    """11.9.3.4."""
    if number <= 64:
        bits.put(number - 1, 7)
    else:
        bits.put(1, 1)
        _length(bits, number)


def _length(bits: Bits, number: int) -> None:
    """11.9.3.6, 11.9.3.7: below 16 K."""
    if number < 128:
        bits.put(number, 8)
    else:
        bits.put(0x8000 | number, 16)


def _fragments(bits: Bits, count: int, put: Callable[[int, int], None]) -> None:
    """11.9.3.8: put(start, end) writes a stretch of what is counted."""
    start = 0
    while count - start >= K16:
        blocks = min(4, (count - start) // K16)
        bits.put(0xC0 | blocks, 8)
        put(start, start + blocks * K16)
        start += blocks * K16
    _length(bits, count - start)
    put(start, count)


def general(bits: Bits, octets: bytes) -> None:
    """Octets with a length that nothing bounds."""
    _fragments(bits, len(octets), lambda start, end: bits.put_all(octets[start:end]))


def open_type(bits: Bits, encode: Encode, value: Any) -> None:
    """11.2."""
    inner = Bits()
    encode(inner, value)
    general(bits, inner.octets())


def sized(bits: Bits, count: int, allowed: Allowed, put: Callable[[int, int], None]) -> None:
    """11.9.4: the length that a size constraint asks for, and what it counts."""
    low, high = allowed.low or 0, allowed.high
    if allowed.is_extensible:
        bits.put(not allowed.holds(count), 1)
    if not allowed.holds(count):
        assert allowed.is_extensible, f"{count} is not in {allowed}"
        low, high = 0, None
    if high is None or high >= K64:
        _fragments(bits, count, put)
        return
    bits.put(count - low, (high - low).bit_length())
    put(0, count)


# ---------------------------------------------------------------- 12 to 17, 24, 25, 30: what has no components


def boolean(bits: Bits, value: bool) -> None:
    bits.put(value, 1)


def null(bits: Bits, value: None) -> None:
    assert value is None


def integer(allowed: Allowed) -> Encode:
    """13."""
    low, high = allowed.low, allowed.high

    def encode(bits: Bits, value: int) -> None:
        is_outside = not allowed.holds(value)
        assert allowed.is_extensible or not is_outside, f"{value} is not in {allowed}"
        if allowed.is_extensible:
            bits.put(is_outside, 1)
        if is_outside or low is None:
            size = (value.bit_length() if value >= 0 else (~value).bit_length()) // 8 + 1
            general(bits, value.to_bytes(size, "big", signed=True))  # 11.8
        elif high is None:
            general(bits, (value - low).to_bytes(max(1, ((value - low).bit_length() + 7) // 8), "big"))  # 11.7
        else:
            bits.put(value - low, (high - low).bit_length())  # 11.5.6

    return encode


def enumerated(type_: t.Enumerated) -> Encode:
    """14."""
    width = (len(type_.root) - 1).bit_length()
    root = {one.name: index for index, one in enumerate(sorted(type_.root, key=lambda one: one.value))}
    additions = {one.name: index for index, one in enumerate(type_.additions)}

    def encode(bits: Bits, value: str | int) -> None:
        if type_.is_extensible:
            bits.put(value not in root, 1)
        if isinstance(value, str) and value in root:
            bits.put(root[value], width)
        else:
            small(bits, additions[value] if isinstance(value, str) else value)

    return encode


def bit_string(allowed: Allowed, has_names: bool) -> Encode:
    """16."""

    def encode(bits: Bits, value: tuple[bytes, int]) -> None:
        octets, count = value
        number = int.from_bytes(octets, "big") >> (8 * len(octets) - count)
        if has_names:  # 16.2, 16.3: without trailing zeros, but for those that the size asks for
            while count > (allowed.low or 0) and not number & 1:
                number, count = number >> 1, count - 1
            missing = max(0, (allowed.low or 0) - count)
            number, count = number << missing, count + missing

        def put(start: int, end: int) -> None:
            bits.put(number >> (count - end) & ((1 << (end - start)) - 1), end - start)

        sized(bits, count, allowed, put)

    return encode


def octet_string(allowed: Allowed) -> Encode:
    """17."""

    def encode(bits: Bits, value: bytes) -> None:
        sized(bits, len(value), allowed, lambda start, end: bits.put_all(value[start:end]))

    return encode


def character_string(kind: str, constraints: Sequence[t.Constraint]) -> Encode:
    """30."""
    if kind not in KNOWN_MULTIPLIER:
        assert kind == "UTF8String", kind  # 30.6: size constraints are invisible
        return lambda bits, value: general(bits, value.encode())
    allowed = sizes(constraints)
    ranges = alphabet(constraints) or KNOWN_MULTIPLIER[kind]
    codes = [code for low, high in ranges for code in range(int(low), int(high) + 1)]
    width = (len(codes) - 1).bit_length()  # 30.5.2
    numbers = {code: code if codes[-1] < 1 << width else index for index, code in enumerate(codes)}  # 30.5.4

    def encode(bits: Bits, value: str) -> None:
        def put(start: int, end: int) -> None:
            for character in value[start:end]:
                bits.put(numbers[ord(character)], width)

        sized(bits, len(value), allowed, put)

    return encode


def object_identifier(is_relative: bool) -> Encode:
    """24, 25: contents octets as BER has them (X.690 8.19, 8.20)."""

    def encode(bits: Bits, value: str) -> None:
        arcs = [int(arc) for arc in value.split(".")]
        if not is_relative:
            arcs = [40 * arcs[0] + arcs[1], *arcs[2:]]
        general(bits, b"".join(map(_arc, arcs)))

    return encode


def _arc(number: int) -> bytes:
    octets = [number & 127]
    while number := number >> 7:
        octets.append(128 | number & 127)
    return bytes(reversed(octets))


def list_of(allowed: Allowed, element: Encode) -> Encode:
    """20."""

    def encode(bits: Bits, value: Sequence[Any]) -> None:
        def put(start: int, end: int) -> None:
            for one in value[start:end]:
                element(bits, one)

        sized(bits, len(value), allowed, put)

    return encode
