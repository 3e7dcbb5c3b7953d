"""Widths in bits: of lengths and units, and the fewest that a value of a type takes."""

from asn1 import constraints as sets
from asn1.constraints import Bounds
from asn1.nodes import Kind, Node


def count_width(bounds: Bounds) -> int | None:
    """Bits of a constrained length (X.691 11.9.4.1); None for a general one: no upper bound, or one of 64K and more."""
    return bounds.width if bounds.high is not None and bounds.high < 65536 else None


def unit_bits(node: Node) -> int:
    """Of a character of a known-multiplier string (X.691 30.5.2), an octet or a bit."""
    match node.kind:
        case Kind.BIT_STRING | Kind.SMALL_BITS:
            return 1
        case Kind.IA5 | Kind.VISIBLE | Kind.PRINTABLE | Kind.NUMERIC:
            if node.alphabet is not None:
                return (sets.count(node.alphabet) - 1).bit_length()
            return 4 if node.kind is Kind.NUMERIC else 7
        case _:
            return 8


# A SEQUENCE that always looks the same is read and written as part of what holds it, up to this many values.
FLAT_MAX = 8


def is_flat(node: Node) -> bool:
    """A small SEQUENCE of numbers only: no optional component, no extension, no length."""
    return node.kind is Kind.SEQUENCE and 0 < _flat_values(node) <= FLAT_MAX


def _flat_values(node: Node) -> int:
    """How many numbers it holds; more than FLAT_MAX where it is not flat."""
    if node.kind in (Kind.BOOLEAN, Kind.SMALL_BITS):
        return 1
    if node.kind is Kind.INTEGER and node.bounds.width is not None and not node.is_extensible:
        return 1
    if node.kind is Kind.ENUMERATED and not node.is_extensible:
        return 1
    if node.kind is not Kind.SEQUENCE or node.is_extensible or node.recurs or any(f.is_optional for f in node.fields):
        return FLAT_MAX + 1
    return sum(_flat_values(f.node) for f in node.fields)


def minimal_bits(node: Node, known: dict[Node, int], elements: bool = True) -> int:
    """No value of the type takes fewer bits; a type inside itself counts as nothing there.

    elements  whether elements of lists and open types count.
    """
    if node not in known:
        known[node] = 0
        known[node] = _minimal_bits(node, known, elements)
    return known[node]


# CAPTAIN_MAX_EMPTY: elements without bits, which a few octets could announce any number of.
EMPTY_MAX = 65536


def is_endless(node: Node) -> bool:
    """A list whose octets do not bound it, nor its type: decode and encode take EMPTY_MAX of them."""
    high = node.bounds.high
    may_be_long = high is None or high > EMPTY_MAX or node.is_extensible
    return may_be_long and minimal_bits(node.item, {}) == 0


def own_bits(node: Node) -> int:
    """No value of the type takes fewer bits beside those of elements of lists and of open types."""
    return minimal_bits(node, {}, elements=False)


def _minimal_bits(node: Node, known: dict[Node, int], elements: bool) -> int:
    match node.kind:
        case Kind.BOOLEAN:
            return 1
        case Kind.NULL:
            return 0
        case Kind.INTEGER:
            return node.is_extensible + min(16, node.bounds.width if node.bounds.width is not None else 16)
        case Kind.ENUMERATED:
            width = (node.root_count - 1).bit_length()
            return 1 + min(width, 7) if node.is_extensible else width
        case Kind.OPEN:
            return 8 if elements else 0
        case Kind.UTF8 | Kind.OID | Kind.RELATIVE_OID:
            return 8
        case Kind.SEQUENCE:
            inside = sum(1 if f.is_optional else minimal_bits(f.node, known, elements) for f in node.root)
            return node.is_extensible + inside
        case Kind.CHOICE:
            inside = min((minimal_bits(f.node, known, elements) for f in node.root), default=0)
            width = (node.root_count - 1).bit_length() + inside
            return 1 + min(width, 15) if node.is_extensible else width
        case _:
            each = unit_bits(node) if node.kind is not Kind.LIST else elements * minimal_bits(node.item, known)
            count = count_width(node.bounds)
            root = (8 if count is None else count) + each * (node.bounds.low or 0)
            return 1 + min(8, root) if node.is_extensible else root
