"""DEFAULT values in C: statements that assign them, conditions that compare them."""

from asn1.backends.c.names import literal, unsigned
from asn1.layout.nodes import Kind, LayoutError, Node
from asn1.model.types import Default


def default_lines(node: Node, default: Default, name: str) -> list[str]:
    """Return statements that assign a DEFAULT.

    Raises LayoutError if the DEFAULT's size differs from that of its type, or if C code cannot initialise its kind.
    """
    match node.kind:
        case Kind.BOOLEAN:
            return [f"{name} = {'true' if default else 'false'};"]
        case Kind.INTEGER if isinstance(default, int):
            return [f"{name} = {literal(default)};"]
        case Kind.ENUMERATED:
            return [f"{name} = {next(item.value for item in node.names if item.name == default)};"]
        case Kind.SMALL_BITS if isinstance(default, tuple):
            return [f"{name} = {unsigned(_number(node, *default))};"]
        case Kind.FIXED_OCTETS if isinstance(default, bytes):
            if len(default) != node.size:
                raise LayoutError(node.c_name, f"a DEFAULT of {len(default)} octets where the size is {node.size}")
            return [f"{name}[{i}] = {octet:#04x};" for i, octet in enumerate(default)]
        case _:
            raise LayoutError(node.c_name, f"a DEFAULT of {node.kind}")


def _number(node: Node, octets: bytes, count: int) -> int:
    """Return a BIT STRING of fixed size as a number. Missing named bits are zeros (X.691 16.3)."""
    if count > node.size or (count < node.size and not node.names):
        raise LayoutError(node.c_name, f"a DEFAULT of {count} bits where the size is {node.size}")
    return int.from_bytes(octets, "big") >> (-count % 8) << (node.size - count)


def differs(node: Node, default: Default, of: str) -> str:
    """Return the C condition that a value differs from its DEFAULT (X.691 19.5).

    Raises LayoutError if the DEFAULT's size differs from that of its type, or if C code cannot compare its kind.
    """
    match node.kind:
        case Kind.BOOLEAN:
            return f"!{of}" if default else of
        case Kind.INTEGER if isinstance(default, int):
            return f"{of} != {literal(default)}"
        case Kind.ENUMERATED:
            return f"{of} != {next(item.value for item in node.names if item.name == default)}"
        case Kind.SMALL_BITS if isinstance(default, tuple):
            return f"{of} != {unsigned(_number(node, *default))}"
        case Kind.FIXED_OCTETS if isinstance(default, bytes):
            octets = "".join(f"\\{octet:03o}" for octet in default)
            return f'memcmp({of}, "{octets}", {len(default)}) != 0'
        case _:
            raise LayoutError(node.c_name, f"a DEFAULT of {node.kind}")
