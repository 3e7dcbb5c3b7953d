"""Limits of the C code: 64-bit numbers, 32-bit sizes, sizes of tables."""

from collections.abc import Iterator

from asn1.backends.c.defaults import default_lines
from asn1.layout.memory import number_octets
from asn1.layout.nodes import Field, Kind, Layout, LayoutError, Node

# Highest item of an ENUMERATED. Greater numbers are unknown items (CAPTAIN_UNKNOWN).
ITEM_MAX = (1 << 30) - 1
ADDITIONS_MAX = 64  # the bitmap of known additions is a 64-bit word
SIZE_MAX = (1 << 32) - 2  # a count is a uint32_t; a comparison with its maximum would always be true
GAPS_MAX = 255  # width of captain_type.gaps_count


def limits(layout: Layout) -> Iterator[LayoutError]:
    """Yield every error that prevents code generation, in the order of modules and types."""
    for nodes in layout.nodes.values():
        for node in nodes:
            yield from (LayoutError(node.c_name, reason) for reason in _reasons(node))
            for f in node.fields:
                yield from _default(node, f)


def _reasons(node: Node) -> Iterator[str]:
    if node.kind is Kind.SEQUENCE and node.additions > ADDITIONS_MAX:
        yield f"{node.additions} extension additions, {ADDITIONS_MAX} is the most"
    if node.kind is Kind.INTEGER and not all(map(_range_of(node).__contains__, _numbers(node))):
        yield "numbers wider than 64 bits"
    if node.kind is not Kind.INTEGER and any(number > SIZE_MAX for number in _numbers(node)):
        yield f"a size of more than {SIZE_MAX}"
    if len(node.bounds.gaps) > GAPS_MAX:
        yield f"{len(node.bounds.gaps)} gaps between the values that are allowed, {GAPS_MAX} is the most"
    for name in node.names:
        if node.kind is Kind.ENUMERATED and not -ITEM_MAX <= name.value <= ITEM_MAX:
            yield f"an item of {name.value}"
        elif not -(1 << 63) <= name.value < 1 << 63:
            yield "a number wider than 64 bits has a name"
    if any(not -(1 << 63) <= id_ < 1 << 63 for id_, _ in node.rows):
        yield "an identifier wider than 64 bits"


def _numbers(node: Node) -> Iterator[int]:
    """Yield every bound of the value or size."""
    for low, high in ((node.bounds.low, node.bounds.high), *node.bounds.gaps):
        yield from (number for number in (low, high) if number is not None)


def _range_of(node: Node) -> range:
    """Return the range of the number's type in memory."""
    octets, is_signed = number_octets(node)
    return range(-(1 << 8 * octets - 1), 1 << 8 * octets - 1) if is_signed else range(1 << 8 * octets)


def _default(node: Node, f: Field) -> Iterator[LayoutError]:
    if f.default is None:
        return
    c_name = f"{node.c_name}_{f.name.replace('-', '_')}"
    try:
        default_lines(f.node, f.default, "")
    except LayoutError as error:
        yield LayoutError(c_name, error.reason)
        return
    if f.node.kind is Kind.INTEGER and isinstance(f.default, int) and not _holds(f.node, f.default):
        yield LayoutError(c_name, f"a DEFAULT of {f.default}, which is not allowed")


def _holds(node: Node, number: int) -> bool:
    low, high = node.bounds.low, node.bounds.high
    in_root = (low is None or number >= low) and (high is None or number <= high)
    in_gap = any(first <= number <= last for first, last in node.bounds.gaps if first is not None and last is not None)
    return number in _range_of(node) and ((in_root and not in_gap) or node.is_extensible)
