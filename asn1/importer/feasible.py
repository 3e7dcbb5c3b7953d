"""What is imported and yet cannot be generated is said where the module is read, with its line."""

from collections.abc import Iterator, Mapping

from asn1.c.limits import limits
from asn1.importer.fault import ImportFault, Place, Problem
from asn1.importer.program import Source
from asn1.layout import lay_out
from asn1.nodes import Kind, Layout, LayoutError, Node
from asn1.types import Schema


def require_feasible(schema: Schema, sources: Mapping[str, Source]) -> None:
    """Raises ImportFault for types, reached by the messages, that have no layout or that C cannot say.

    sources  the modules that were read, by key; the line is that of the definition.
    """
    try:
        layout = lay_out(schema, tuple(schema.messages.values()))
        found = [*limits(layout), *_endless(layout)]
    except LayoutError as error:
        found = [error]
    if found:
        raise ImportFault([_problem(error, sources) for error in found])


def _endless(layout: Layout) -> Iterator[LayoutError]:
    """Definitions of which no finite value can be written: they need a value of themselves."""
    nodes = [node for of_module in layout.nodes.values() for node in of_module]
    ending: set[Node] = set()
    while more := [node for node in nodes if node not in ending and _ends(node, ending)]:
        ending.update(more)
    for node in nodes:
        if node not in ending and node.recurs and node.is_defined:
            reason = "it holds itself and has no end: make a component OPTIONAL or a list of it"
            yield LayoutError(node.c_name, reason)


def _ends(node: Node, ending: set[Node]) -> bool:
    """Whether a value of finite length can be made from such of `ending`."""
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
