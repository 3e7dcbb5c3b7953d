"""C++ header of a module: generates views with the names of components.

captain/<module key>.hpp defines a view for every SEQUENCE and CHOICE, and maps every struct to its table. The common
templates for views are in messages.hpp.
"""

from collections.abc import Iterator
from pathlib import Path

from asn1.backends.c.library import member
from asn1.layout.nodes import Field, Kind, Layout, Node
from asn1.model.types import Module

# Names that a view already has: its own, and those inherited from captain/messages.hpp.
TAKEN = frozenset({"view", "record", "visit", "index"})


def generate(layout: Layout, folder: Path) -> None:
    """Write one header per module of the layout to a folder."""
    for key, every in layout.nodes.items():
        nodes = [node for node in every if node.form_of is None]
        (folder / f"{key}.hpp").write_text(header(layout.schema.modules[key], nodes), encoding="utf-8")


def header(module: Module, nodes: list[Node]) -> str:
    """Return the header of one module.

    Modules may include each other: views are instantiated when a method is called.
    """
    guard = f"CAPTAIN_{module.key.upper()}_HPP"
    others = sorted({child.module for node in nodes for child in node.children()} - {module.key})
    lines = [
        f"// C++ views of {module.name}, {module.standard}",
        f"// generated from {module.source}, sha256 {module.sha256}",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        f'#include "captain/{module.key}.h"',
        '#include "captain/messages.hpp"',
        *(f'#include "captain/{key}.hpp"' for key in others),
        "",
        "namespace captain {",
        "",
        *(line for node in nodes if _has_table(node) for line in _type_of(node)),
        *(line for node in nodes for line in _view(node)),
        "} // namespace captain",
        "",
        "#endif",
    ]
    return "\n".join(lines) + "\n"


def _has_table(node: Node) -> bool:
    return node.kind in (Kind.SEQUENCE, Kind.CHOICE, Kind.LIST)


def _type_of(node: Node) -> Iterator[str]:
    yield f"template <> inline const captain_type &type_of<{node.c_name}>() noexcept {{ return {node.c_name}_type; }}"


def _view(node: Node) -> Iterator[str]:
    if node.kind not in (Kind.SEQUENCE, Kind.CHOICE):
        return
    yield f"template <class Lazy> class view<{node.c_name}, Lazy> : public record<{node.c_name}> {{"
    yield "public:"
    yield f"    using record<{node.c_name}>::record;"
    if node.kind is Kind.SEQUENCE:
        yield from map(_component, node.fields)
    else:
        yield "    std::uint32_t index() const noexcept { return this->self_->choice; }"
        yield from (_alternative(number, field) for number, field in enumerate(node.fields, 1))
        yield from _visit(node)
    yield "};"


def _component(field: Field) -> str:
    name = member(field.name)
    if field.is_optional and field.default is None:
        seen = f"see_if<Lazy>(this->self_->has_{name}, this->self_->{name})"
    else:
        seen = f"see<Lazy>(this->self_->{name})"
    return f"    auto {_method(field)}() const {{ return {seen}; }}"


def _alternative(number: int, field: Field) -> str:
    name = member(field.name)
    return f"    auto {_method(field)}() const {{ return see_if<Lazy>(index() == {number}, this->self_->u.{name}); }}"


def _visit(node: Node) -> Iterator[str]:
    yield "    template <class F> auto visit(F &&visitor) const"
    yield "    {"
    yield "        switch (index()) {"
    for number, field in enumerate(node.fields, 1):
        yield f"        case {number}: return visitor(see<Lazy>(this->self_->u.{member(field.name)}));"
    if node.is_extensible:
        yield "        case 0: return visitor(std::monostate());"
        yield "        default: return visitor(unknown{index() - CAPTAIN_UNKNOWN, see<Lazy>(this->self_->u.unknown)});"
    else:
        yield "        default: return visitor(std::monostate());"
    yield "        }"
    yield "    }"


def _method(field: Field) -> str:
    name = member(field.name)
    return f"{name}_" if name in TAKEN else name
