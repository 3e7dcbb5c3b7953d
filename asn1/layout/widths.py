"""Widths in bits: of lengths and units, and the fewest bits of a type."""

from asn1.layout.nodes import Kind, Node
from asn1.model import constraints as sets
from asn1.model.constraints import Bounds


def count_width(bounds: Bounds) -> int | None:
    """Return the bits of a constrained length (X.691 11.9.4.1).

    Returns None for a general length: without an upper bound, or with one of 65536 or more.
    """
    return bounds.width if bounds.high is not None and bounds.high < 65536 else None


def unit_bits(node: Node) -> int:
    """Return the bits of one unit: a character (X.691 30.5.2), an octet or a bit."""
    match node.kind:
        case Kind.BIT_STRING | Kind.SMALL_BITS:
            return 1
        case Kind.IA5 | Kind.VISIBLE | Kind.PRINTABLE | Kind.NUMERIC:
            if node.alphabet is not None:
                return (sets.count(node.alphabet) - 1).bit_length()
            return 4 if node.kind is Kind.NUMERIC else 7
        case _:
            return 8


# A SEQUENCE of constant width with at most this many values is coded by the function of its container.
FLAT_MAX = 8


def is_flat(node: Node) -> bool:
    """Return whether a type is a small SEQUENCE of numbers only: no optional component, extension or length."""
    return node.kind is Kind.SEQUENCE and 0 < _flat_values(node) <= FLAT_MAX


def _flat_values(node: Node) -> int:
    """Return the count of numbers in a flat type; more than FLAT_MAX for any other type."""
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
    """Return the fewest bits of a value of the type; a type inside itself counts as 0.

    elements  include elements of lists and open types.
    """
    if node not in known:
        known[node] = 0
        known[node] = _minimal_bits(node, known, elements)
    return known[node]


# CAPTAIN_MAX_EMPTY: limit for list elements without bits, because a few octets could announce any number of them.
EMPTY_MAX = 65536


def is_endless(node: Node) -> bool:
    """Return whether neither octets nor type bound a list's length.

    decode and encode accept EMPTY_MAX elements of such a list.
    """
    high = node.bounds.high
    may_be_long = high is None or high > EMPTY_MAX or node.is_extensible
    return may_be_long and minimal_bits(node.item, {}) == 0


def own_bits(node: Node) -> int:
    """Return the fewest bits of a value of the type, without elements of lists and open types."""
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
