"""Tables in C: generates a constant table per type.

They have a file of their own, so that their size is measured separately from that of the code.
"""

from collections.abc import Iterator

from asn1.backends.c.defaults import default_lines
from asn1.backends.c.header import title
from asn1.backends.c.names import has_check, has_public_table, literal, member, needs_functions, value_type
from asn1.backends.c.predicate import is_inner
from asn1.layout.memory import number_octets
from asn1.layout.nodes import STRUCTS, Field, Kind, Node
from asn1.layout.widths import unit_bits
from asn1.model.constraint_text import constraint_text
from asn1.model.constraints import Ranges
from asn1.model.types import Constraint, Module

_STRINGS = frozenset({Kind.IA5, Kind.VISIBLE, Kind.PRINTABLE, Kind.NUMERIC})
_BOUNDED = _STRINGS | {Kind.INTEGER, Kind.LIST, Kind.BIT_STRING, Kind.OCTET_STRING, Kind.UTF8}


def tables(module: Module, nodes: list[Node]) -> str:
    """Return src/<module key>_tables.c."""
    others = sorted({child.module for node in nodes for child in node.children()} - {module.key})
    lines = [
        *title(module),
        f'#include "{module.key}.h"',
        *(f'#include "{key}.h"' for key in others),
        "",
        *(line for node in nodes for line in _table(node)),
    ]
    return "\n".join(lines) + "\n"


def text(value: str | None) -> str:
    """Return a string as a C literal."""
    if value is None:
        return "NULL"
    escaped = "".join(
        c if " " <= c <= "~" and c not in '"\\?' else "".join(f"\\{o:03o}" for o in c.encode()) for c in value
    )
    return f'"{escaped}"'


def _table(node: Node) -> Iterator[str]:
    for f in node.fields:
        if f.default is not None:
            yield from _default(node, f)
    yield from _array(node, "alphabet", "captain_range", _ranges(node.alphabet or ()))
    yield from _array(node, "gaps", "captain_range", _ranges(node.bounds.gaps))
    yield from _array(node, "names", "captain_name", [f"{{{text(n.name)}, {literal(n.value)}}}" for n in node.names])
    yield from _array(node, "fields", "captain_field", [_field(node, f) for f in node.fields])
    yield from _array(node, "rows", "captain_row", [f"{{{literal(i)}, &{row.c_name}_type}}" for i, row in node.rows])
    yield f"{'' if has_public_table(node) else 'CAPTAIN_HIDDEN '}const captain_type {node.c_name}_type = {{"
    yield from (f"    .{name} = {value}," for name, value in _members(node))
    yield "};"
    yield ""


def _array(node: Node, name: str, type_: str, items: list[str]) -> Iterator[str]:
    if items:
        yield f"static const {type_} {node.c_name}_{name}_[] = {{"
        yield from (f"    {item}," for item in items)
        yield "};"


def _ranges(ranges: Ranges) -> list[str]:
    return [
        f"{{{literal(r.low or 0)}, {literal(r.high or 0)}}}" for r in ranges if r.low is not None and r.high is not None
    ]


def _members(node: Node) -> Iterator[tuple[str, str]]:
    for name, value in (("name", node.asn_name), ("unit", node.unit), ("standard", node.standard)):
        if value is not None:
            yield name, text(value)
    if rule := _rule(node):
        yield "rule", text(rule)
    yield "kind", f"CAPTAIN_{node.kind}"
    flags = list(_flags(node))
    if flags:
        yield "flags", " | ".join(f"CAPTAIN_{flag}" for flag in flags)
    if node.kind in (Kind.INTEGER, Kind.SMALL_BITS):
        yield "width", str(number_octets(node)[0])
    if node.kind in _STRINGS:
        yield "character_bits", str(unit_bits(node))
    yield "size", f"sizeof({value_type(node)}{f'[{node.size}]' if node.kind is Kind.FIXED_OCTETS else ''})"
    yield from _bounds(node)
    for name, count in (
        ("alphabet", len(_ranges(node.alphabet or ()))),
        ("gaps", len(_ranges(node.bounds.gaps))),
        ("names", len(node.names)),
        ("fields", len(node.fields)),
        ("rows", len(node.rows)),
    ):
        if count:
            yield name, f"{node.c_name}_{name}_"
            yield f"{name}_count", str(count)
    if node.element is not None:
        yield "element", f"&{node.element.c_name}_type"
    if node.kind is Kind.OPEN:
        yield "selector", str(node.selector)
    if node.kind is Kind.SEQUENCE:
        yield "additions", f"offsetof({node.struct_name}, additions)" if node.is_extensible else "CAPTAIN_NOWHERE"
    if node.root_count:
        yield "root_count", str(node.root_count)
    if node.additions:
        yield "additions_count", str(node.additions)
    if needs_functions(node):
        yield "decode", f"{node.c_name}_read"
        yield "encode", f"{node.c_name}_write"
    if has_check(node):
        yield "validate", f"{node.c_name}_check"


def _rule(node: Node) -> str:
    """Return the constraints that generated code checks beyond bounds: of the type, its components and its elements."""
    parts = [
        *_inner(node.constraints, ""),
        *(part for f in node.fields for part in _inner(f.checks, f"{f.name} ")),
        *_inner(node.element_checks, "each "),
    ]
    return ", ".join(parts)


def _inner(constraints: tuple[Constraint, ...], of: str) -> list[str]:
    asked = [one for one in constraints if is_inner(one.root) and not one.is_extensible]
    return [f"{of}{constraint_text(one, lambda _: '')}" for one in asked]


def _flags(node: Node) -> Iterator[str]:
    if node.is_extensible:
        yield "EXTENSIBLE"
    if node.kind in _BOUNDED:
        if node.bounds.low is None:
            yield "UNBOUNDED_LOW"
        if node.bounds.high is None:
            yield "UNBOUNDED_HIGH"
    if node.kind is Kind.INTEGER and number_octets(node)[1]:
        yield "SIGNED"
    if node.kind in (Kind.BIT_STRING, Kind.SMALL_BITS) and node.names:
        yield "NAMED_BITS"
    if node.recurs and node.kind in STRUCTS:
        yield "RECURS"


def _bounds(node: Node) -> Iterator[tuple[str, str]]:
    if node.bounds.low:
        yield "low", literal(node.bounds.low)
    if node.bounds.high:
        high = node.bounds.high
        yield "high", literal(high) if high < 1 << 63 else f"(int64_t){literal(high)}"


def _field(node: Node, f: Field) -> str:
    name = member(f.name)
    path = f"u.{name}" if node.kind is Kind.CHOICE else name
    parts = [f".name = {text(f.name)}", f".type = &{f.node.c_name}_type"]
    if f.default is not None:
        parts.append(f".default_value = &{node.c_name}_{name}_default_")
    if f.unit is not None:
        parts.append(f".unit = {text(f.unit)}")
    parts.append(f".offset = offsetof({node.struct_name}, {path})")
    parts.append(f".present = {f'offsetof({node.struct_name}, has_{name})' if f.is_optional else 'CAPTAIN_NOWHERE'}")
    if f.addition:
        parts.append(f".addition = {f.addition}")
    flags = [
        word
        for word, holds in (
            ("OPTIONAL", f.is_optional), ("DEFAULT", f.default is not None), ("POINTER", f.is_pointer),
            ("GROUP", f.in_group), ("MANDATORY", f.is_mandatory),
        )
        if holds
    ]  # fmt: skip
    if flags:
        parts.append(f".flags = {' | '.join(f'CAPTAIN_{flag}' for flag in flags)}")
    return f"{{{', '.join(parts)}}}"


def _default(node: Node, f: Field) -> Iterator[str]:
    name = f"{node.c_name}_{member(f.name)}_default_"
    lines = default_lines(f.node, f.default, "x")
    values = ", ".join(line.partition(" = ")[2].rstrip(";") for line in lines)
    if f.node.kind is Kind.FIXED_OCTETS:
        yield f"static const uint8_t {name}[] = {{{values}}};"
    else:
        yield f"static const {value_type(f.node)} {name} = {values};"
