"""What is imported and yet cannot be generated is said where the module is read, with its line."""

from collections.abc import Mapping

from asn1.c.limits import limits
from asn1.importer.fault import ImportFault, Place, Problem
from asn1.importer.program import Source
from asn1.layout import lay_out
from asn1.nodes import LayoutError
from asn1.types import Schema


def require_feasible(schema: Schema, sources: Mapping[str, Source]) -> None:
    """Raises ImportFault for types, reached by the messages, that have no layout or that C cannot say.

    sources  the modules that were read, by key; the line is that of the definition.
    """
    try:
        found = list(limits(lay_out(schema, tuple(schema.messages.values()))))
    except LayoutError as error:
        found = [error]
    if found:
        raise ImportFault([_problem(error, sources) for error in found])


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
