"""Where values lie in memory: widths of numbers, sizes of structs, and what lies behind a pointer."""

from asn1.nodes import STRUCTS, Field, Kind, Node

# A component that may be absent, or is one of several, lies behind a pointer where its struct is larger (octets).
INLINE_MAX = 128


def number_octets(node: Node) -> tuple[int, bool]:
    """Of an INTEGER or a small BIT STRING in memory: octets, and whether it is signed."""
    if node.kind is Kind.SMALL_BITS:
        return next(w for w in (1, 2, 4, 8) if node.size <= 8 * w), False
    low, high = node.bounds.low, node.bounds.high
    if low is None or high is None or node.is_extensible:
        return 8, True
    is_signed = low < 0
    for octets in (1, 2, 4, 8):
        bits = 8 * octets
        least, most = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if is_signed else (0, (1 << bits) - 1)
        if least <= low and high <= most:
            return octets, is_signed
    raise ValueError(f"{node.c_name}: {low}..{high} is wider than 64 bits")


def measure(node: Node, known: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    """(octets, alignment) where pointers have 8 octets.

    Decides which fields lie behind a pointer, on every machine alike.
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
