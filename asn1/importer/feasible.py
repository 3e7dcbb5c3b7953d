"""Refusal of types that can be imported but not generated; errors cite the line."""

from collections.abc import Iterator, Mapping

from asn1.backends.c.limits import limits
from asn1.importer.parser.fault import ImportFault, Place, Problem
from asn1.importer.resolver.program import Source
from asn1.layout.layout import lay_out
from asn1.layout.nodes import Kind, Layout, LayoutError, Node
from asn1.model.types import Schema


def require_feasible(schema: Schema, sources: Mapping[str, Source]) -> None:
    """Check the types that the messages use.

    sources  parsed modules by key; errors cite the line of the definition.

    Raises ImportFault for types without a layout, or that C cannot represent.
    """
    try:
        layout = lay_out(schema, tuple(schema.messages.values()))
        found = [*limits(layout), *_endless(layout)]
    except LayoutError as error:
        found = [error]
    if found:
        raise ImportFault([_problem(error, sources) for error in found])


def _endless(layout: Layout) -> Iterator[LayoutError]:
    """Yield an error for each definition that always contains itself, so that no finite value exists."""
    nodes = [node for of_module in layout.nodes.values() for node in of_module]
    ending: set[Node] = set()
    while more := [node for node in nodes if node not in ending and _ends(node, ending)]:
        ending.update(more)
    for node in nodes:
        if node not in ending and node.recurs and node.is_defined:
            reason = "the type contains itself without end: make a recursive component OPTIONAL or a list"
            yield LayoutError(node.c_name, reason)


def _ends(node: Node, ending: set[Node]) -> bool:
    """Return whether a type has a finite value, assuming that the types in `ending` have one."""
    match node.kind:
        case Kind.SEQUENCE:
            return all(f.is_optional or f.node in ending for f in node.fields)
        case Kind.CHOICE:
            return node.is_extensible or any(f.node in ending for f in node.fields)
        case Kind.LIST:
            return not node.bounds.low or node.item in ending
        case _:
            return True


def _problem(error: LayoutError, sources: Mapping[str, Source]) -> Problem:
    places: dict[str, tuple[str, Place]] = {}
    for key, source in sources.items():
        places[key] = (key, source.module.place)
        for name, assignment in source.module.assignments.items():
            places[f"{key}_{name.replace('-', '_')}"] = (key, assignment.place)
    stem = error.c_name
    while stem and stem not in places:
        stem = stem.rpartition("_")[0]
    if not stem:
        raise error
    key, place = places[stem]
    return Problem(place, f"{error.c_name.removeprefix(key + '_')}: {error.reason}")
