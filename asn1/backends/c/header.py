"""Headers of a module: the public one, and one for generated sources."""

from collections.abc import Iterator

from asn1.backends.c.names import (
    declaration,
    field_declaration,
    has_check,
    has_public_table,
    literal,
    member,
    needs_functions,
)
from asn1.layout.nodes import STRUCTS, SUFFIXES, Kind, Node
from asn1.model.types import Module

_INT_MAX = (1 << 31) - 1


def public_header(module: Module, nodes: list[Node]) -> str:
    """Return captain/<module key>.h: structs, named numbers, tables and functions.

    An -ext form shares its type's struct.
    """
    nodes = [node for node in nodes if node.form_of is None]
    guard = f"CAPTAIN_{module.key.upper()}_H"
    held = {f.node.module for n in nodes for f in n.fields if f.node.kind in STRUCTS and not f.is_pointer} - {
        module.key
    }
    seen = {child.module for n in nodes for child in n.children() if child.kind in STRUCTS} - held - {module.key}
    constants = _Constants(nodes)
    lines = [
        *title(module),
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "#include <captain/runtime.h>",
        *(f"#include <captain/{key}.h>" for key in sorted(held)),
        "",
        *_BEGIN,
        *(line for node in nodes for line in _definition(node, constants)),
        "",
        *(f"extern const captain_type {node.c_name}_type;" for node in nodes if has_public_table(node)),
        "",
        *(
            line
            for node in nodes
            if node.kind in STRUCTS or (node.is_entry and node.is_defined)
            for line in _functions(node)
        ),
        *_END,
        # These follow the definitions, because modules may refer to each other by pointers.
        *(f"#include <captain/{key}.h>" for key in sorted(seen)),
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def private_header(module: Module, nodes: list[Node]) -> str:
    """Return src/<module key>.h: generated functions and tables outside the public interface."""
    guard = f"CAPTAIN_{module.key.upper()}_PRIVATE_H"
    return "\n".join(
        [
            *title(module),
            f"#ifndef {guard}",
            f"#define {guard}",
            "",
            '#include "bits.h"',
            f"#include <captain/{module.key}.h>",
            "",
            *(f"CAPTAIN_HIDDEN extern const captain_type {n.c_name}_type;" for n in nodes if not has_public_table(n)),
            *(line for node in nodes for line in _private_functions(node)),
            "#endif",
            "",
        ]
    )


def title(module: Module) -> list[str]:
    return [
        f"/* {module.name}, {module.standard}: made by captain-asn1",
        f" * from {module.source}, sha256 {module.sha256} */",
    ]


_BEGIN = ["#ifdef __cplusplus", 'extern "C" {', "#endif", ""]
_END = ["#ifdef __cplusplus", "}", "#endif", ""]


class _Constants:
    """Names of constants, unique among themselves and among types, tables and functions."""

    def __init__(self, nodes: list[Node]) -> None:
        self.taken = {node.c_name + suffix for node in nodes for suffix in ("", *SUFFIXES)}

    def free(self, name: str) -> str:
        while name in self.taken:
            name += "_"
        self.taken.add(name)
        return name


def _definition(node: Node, constants: _Constants) -> Iterator[str]:
    if node.kind in STRUCTS:
        yield f"typedef struct {node.c_name} {{"
        yield from (f"    {line}" for line in _members(node))
        yield f"}} {node.c_name};"
    elif node.is_defined:
        yield f"typedef {declaration(node, node.c_name)};{f' /* {_comment(node.unit)} */' if node.unit else ''}"
    if node.kind is Kind.CHOICE:
        items = (f"{constants.free(f'{node.c_name}_IS_{member(f.name)}')} = {k}" for k, f in enumerate(node.fields, 1))
        yield f"enum {{ {', '.join(items)} }};"
    if node.names and node.kind in (Kind.INTEGER, Kind.ENUMERATED):
        yield from _numbers(node, constants)


def _numbers(node: Node, constants: _Constants) -> Iterator[str]:
    small = []
    for name, value in node.names:
        word = constants.free(f"{node.c_name}_{name.replace('-', '_')}")
        if -_INT_MAX <= value <= _INT_MAX:
            small.append(f"    {word} = {value}")
        else:
            yield f"#define {word} {literal(value)}"
    if small:
        yield "enum {"
        yield ",\n".join(small)
        yield "};"


def _members(node: Node) -> Iterator[str]:
    if node.kind is Kind.LIST:
        yield "uint32_t count;"
        yield f"{declaration(node.item, 'items', is_pointer=True)};"
    elif node.kind is Kind.CHOICE:
        yield "uint32_t choice;"
        if node.fields or node.is_extensible:
            yield "union {"
            yield from (f"    {field_declaration(f)};" for f in node.fields)
            if node.is_extensible:
                yield "    captain_octets unknown;"
            yield "} u;"
    else:
        for f in node.fields:
            if f.is_optional:
                yield f"bool has_{member(f.name)};"
            unit = f.unit or f.node.unit
            yield f"{field_declaration(f)};{f' /* {_comment(unit)} */' if unit else ''}"
        if node.is_extensible:
            yield "const captain_additions *additions;"
        elif not node.fields:
            yield "bool empty;"


def _comment(text: str | None) -> str:
    return (text or "").replace("*/", "* /")


def _functions(node: Node) -> Iterator[str]:
    name = node.c_name
    read = f"{name} *value, const void *octets, size_t size, captain_arena *arena, size_t *bits"
    write = f"const {name} *value, void *octets, size_t size, size_t *bits"
    ways = [("validate", f"const {name} *value", "value")]
    if needs_functions(node):
        ways.insert(0, ("encode", write, "value, octets, size, bits"))
        ways.insert(0, ("decode", read, "value, octets, size, arena, bits"))
    for way, parameters, arguments in ways:
        yield f"static inline captain_status {name}_{way}({parameters})"
        yield "{"
        yield f"    return captain_{way}(&{name}_type, {arguments});"
        yield "}"
    yield ""


def _private_functions(node: Node) -> Iterator[str]:
    if needs_functions(node):
        yield f"CAPTAIN_HIDDEN size_t {node.c_name}_read(captain_reader *r, size_t at, void *to);"
        yield f"CAPTAIN_HIDDEN size_t {node.c_name}_write(captain_writer *w, size_t at, const void *from);"
    if has_check(node):
        yield f"CAPTAIN_HIDDEN captain_status {node.c_name}_check(const void *from);"
