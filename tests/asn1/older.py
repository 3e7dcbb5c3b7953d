"""Values as an older edition sees them: without later additions.

Alternatives and items that it does not know it has no word for, and open types it does not look into.
"""

from typing import Any

from asn1.model import types as t
from tests.asn1.ranges import unfold
from tests.asn1.reach import components


class UnsaidError(Exception):
    """There is no such value."""


def seen_by_older(schema: t.Schema, type_: t.Type, value: Any) -> Any:
    """Raises UnsaidError."""
    base, _ = unfold(schema, type_)
    match base:
        case t.Enumerated() if isinstance(value, int):
            raise UnsaidError
        case t.SequenceOf():
            return [seen_by_older(schema, base.element, one) for one in value]
        case t.Choice():
            chosen = next((one.type for one in components(base) if one.name == value[0]), None)
            if chosen is None:
                raise UnsaidError
            return value[0], seen_by_older(schema, chosen, value[1])
        case t.Sequence():
            known = {one.name: one.type for one in components(base) if one.name in value}
            return {name: _member(schema, held, value[name], value) for name, held in known.items()}
    return value


def _member(schema: t.Schema, type_: t.Type, value: Any, holder: dict[str, Any]) -> Any:
    if not isinstance(type_, t.OpenType):
        return seen_by_older(schema, type_, value)
    rows = schema.modules[type_.set_.module].sets[type_.set_.name].rows
    row = next((row.type for row in rows if row.value == holder[type_.selector]), None)
    if row is not None and seen_by_older(schema, row, value) != value:
        raise UnsaidError
    return value
