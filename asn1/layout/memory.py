"""Memory of values: widths of numbers, sizes of structs, pointers."""

import math
from collections.abc import Iterator

from asn1.layout.nodes import STRUCTS, Field, Kind, LayoutError, Node
from asn1.layout.widths import count_width, minimal_bits, own_bits, unit_bits

# An optional component or alternative whose struct is larger than this (octets) is stored behind a pointer.
INLINE_MAX = 128


def number_octets(node: Node) -> tuple[int, bool]:
    """Return the size in octets of an INTEGER or small BIT STRING in memory, and whether it is signed.

    Raises LayoutError for bounds wider than 64 bits.
    """
    if node.kind is Kind.SMALL_BITS:
        return next(w for w in (1, 2, 4, 8) if node.size <= 8 * w), False
    low, high = node.bounds.low, node.bounds.high
    if low is None or high is None or node.is_extensible or node.bounds.lost_marker:
        return 8, True
    is_signed = low < 0
    for octets in (1, 2, 4, 8):
        bits = 8 * octets
        least, most = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if is_signed else (0, (1 << bits) - 1)
        if least <= low and high <= most:
            return octets, is_signed
    raise LayoutError(node.c_name, f"{low}..{high} is wider than 64 bits")


def measure(node: Node, known: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    """Return (octets, alignment) of a type in memory, for pointers of 8 octets.

    This size decides which fields are stored behind a pointer, so that the decision is the same on every machine.
    """
    if node not in known:
        match node.kind:
            case Kind.BOOLEAN | Kind.NULL:
                known[node] = (1, 1)
            case Kind.INTEGER | Kind.SMALL_BITS:
                octets, _ = number_octets(node)
                known[node] = (octets, octets)
            case Kind.ENUMERATED:
                known[node] = (4, 4)
            case Kind.FIXED_OCTETS:
                known[node] = (node.size, 1)
            case Kind.OPEN:
                known[node] = (32, 8)
            case Kind.SEQUENCE:
                known[node] = _measure_sequence(node, known)
            case Kind.CHOICE:
                known[node] = _measure_choice(node, known)
            case _:
                known[node] = (16, 8)
    return known[node]


def _measure_field(node: Node, f: Field, known: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    if not f.is_pointer:
        size, align = measure(f.node, known)
        f.is_pointer = f.node.kind in STRUCTS and size > INLINE_MAX and (f.is_optional or node.kind is Kind.CHOICE)
        if not f.is_pointer:
            return size, align
    return 8, 8


def _measure_sequence(node: Node, known: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    size, align = 0, 1
    for f in node.fields:
        size += f.is_optional
        field_size, field_align = _measure_field(node, f, known)
        size = _up(size, field_align) + field_size
        align = max(align, field_align)
    if node.is_extensible:
        size, align = _up(size, 8) + 8, 8
    return max(1, _up(size, align)), align


def _measure_choice(node: Node, known: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    size, align = (16, 8) if node.is_extensible else (0, 4)
    for f in node.fields:
        field_size, field_align = _measure_field(node, f, known)
        size, align = max(size, field_size), max(align, field_align)
    return _up(_up(4, align) + size, align), align


def _up(size: int, align: int) -> int:
    return (size + align - 1) // align * align


# ---------------------------------------------------------------- the arena


def arena_octets(pdu: Node) -> int:
    """Return the most arena octets that decoding takes per octet of a message, rounded up.

    One encoded bit can cause memory for a struct, a string and list elements. So the worst ratios of memory to encoded
    bits are added: of a struct, of a string, and of a list element without own bits. The bits of such an element are
    those of its contents, or else of the length of its list.

    Lists and strings of 16384 or more elements are encoded in fragments; for these, the caller multiplies by four.
    """
    sizes: dict[Node, tuple[int, int]] = {}
    nodes = _reached(pdu)
    structs = max((_rate(*one) for node in nodes for one in _structs(node, sizes)), default=0.0)
    strings = max((_rate(*one) for node in nodes for one in _strings(node)), default=0.0)
    poor = sum(_rate(*_poor(node.item, sizes)) for node in nodes if node.kind is Kind.LIST and not own_bits(node.item))
    return math.ceil(8 * (structs + strings + poor))


def _poor(item: Node, sizes: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    """Return memory octets and encoded bits of a list element; of 16383 elements if one is encoded in zero bits."""
    size, bits = measure(item, sizes)[0], minimal_bits(item, {})
    return (size, bits) if bits else (16383 * size, 16)


def _rate(octets: int, bits: int) -> float:
    return (octets + _ALIGNMENT - 1) / bits


_ALIGNMENT = 8
_LENGTH = 8  # bits of the shortest length without a small upper bound (X.691 11.9)


def _structs(node: Node, sizes: dict[Node, tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Yield memory and bits of a node's structs.

    Each pair has the octets that the decoder allocates for a struct, and the fewest bits that it reads for it.
    """
    match node.kind:
        case Kind.LIST:
            if own_bits(node.item):
                yield measure(node.item, sizes)[0], own_bits(node.item)
        case Kind.SEQUENCE | Kind.CHOICE:
            for f in node.fields:
                if f.is_pointer:
                    yield measure(f.node, sizes)[0], max(1, own_bits(f.node) + (_LENGTH if f.addition else 0))
        case Kind.OPEN:
            for _, row in node.rows:
                yield measure(row, sizes)[0], _LENGTH  # the length of its content is unknown here
        case _:
            pass


def _strings(node: Node) -> Iterator[tuple[int, int]]:
    """Yield pairs of memory octets and encoded bits for strings, and for unknown extension additions."""
    match node.kind:
        case Kind.SEQUENCE if node.is_extensible:
            yield _ADDITION + 1, _LENGTH
        case Kind.OPEN | Kind.UTF8 | Kind.OID | Kind.RELATIVE_OID:
            yield 1, _LENGTH
        case Kind.CHOICE if node.is_extensible:
            yield 1, _LENGTH
        case Kind.BIT_STRING | Kind.OCTET_STRING:
            yield 1 + (node.bounds.low or 0) * unit_bits(node) // 8, _least_bits(node)
        case Kind.IA5 | Kind.VISIBLE | Kind.PRINTABLE | Kind.NUMERIC:
            yield from _texts(node)
        case _:
            pass


def _texts(node: Node) -> Iterator[tuple[int, int]]:
    """Yield pairs of memory octets and encoded bits of a character string: an octet per character and a final zero.

    A string with a general length is first collected in packed form.
    """
    least, bits = _least_bits(node), unit_bits(node)
    if node.is_extensible or count_width(node.bounds) is None:
        yield 1 + _ALIGNMENT, _LENGTH
    # Memory per encoded bit is largest in short strings, because of the fixed part, or in long ones.
    yield 1 + (node.bounds.low or 0), least
    if bits == 0 and count_width(node.bounds) is None:
        yield 1 + 16383, 2 * _LENGTH
    elif bits == 0:
        yield 1 + (node.bounds.high or 0), least
    else:
        yield _ALIGNMENT, _ALIGNMENT * bits


def _least_bits(node: Node) -> int:
    """Return the fewest bits of a string of variable size, including its length."""
    width = count_width(node.bounds)
    least = (_LENGTH if width is None else width) + (node.bounds.low or 0) * unit_bits(node)
    return max(1, min(_LENGTH, least) if node.is_extensible else least)


_ADDITION = 24 + 16  # octets of a captain_addition, and of the captain_additions that contains it


def _reached(node: Node) -> list[Node]:
    found = {node: None}
    waiting = [node]
    while waiting:
        for child in waiting.pop().children():
            if child not in found:
                found[child] = None
                waiting.append(child)
    return list(found)
