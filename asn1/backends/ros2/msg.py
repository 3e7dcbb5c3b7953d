"""Text of a .msg file, with comments for developers who do not have the standard."""

from collections.abc import Iterator

from asn1.backends.docs.wording import bounds, default_text, unit_of
from asn1.backends.ros2.model import Role, RosField, RosMessage, RosPackage
from asn1.model.types import Schema

WIDTH = 120


def text(schema: Schema, package: RosPackage, message: RosMessage) -> str:
    """Return the .msg file: source in the standard, and each field with its range, unit, default and constants."""
    lines = [f"# {package.name}/{message.name}: {message.definition.name} of {message.module.standard}"]
    if message.left_out:
        names = ", ".join(".".join(source) for source in message.left_out)
        lines.append(f"# not in this message, though in the standard: {names}")
    for field in message.fields:
        lines += ["", *_comments(schema, message, field), field.text]
        lines += [f"{one.type} {one.name} = {one.value}" for one in field.constants]
    return "\n".join(lines) + "\n"


def _comments(schema: Schema, message: RosMessage, field: RosField) -> Iterator[str]:
    """Yield a comment line, if there is something to say about the field."""
    words = "; ".join(_words(schema, message, field))
    if words:
        yield f"# {words}"


def _words(schema: Schema, message: RosMessage, field: RosField) -> Iterator[str]:
    path = ".".join(field.source)
    match field.role:
        case Role.PRESENT:
            yield f"true if {path} is present"
        case Role.CHOICE:
            yield "number of the chosen alternative"
        case Role.BITS_UNUSED:
            yield "number of unused bits in the last octet, from the lowest"
        case Role.VALUE if field.schema_type is not None:
            unit = unit_at(schema, message, field)
            range_ = bounds(schema, field.schema_type)
            yield from (
                word for word in (range_ if len(range_) < WIDTH else "", f"unit {unit}" if unit else "") if word
            )
            if field.component is not None and field.component.default is not None:
                yield f"default {default_text(field.component.default)}"
        case _:
            return


def unit_at(schema: Schema, message: RosMessage, field: RosField) -> str | None:
    """Return the unit of a field's value 1: that of the component, else of its type.

    A message with this value as its single field has the unit of its definition.
    """
    own = field.component.unit if field.component is not None else None
    if own is None and field.schema_type is not None:
        own = unit_of(schema, field.schema_type)
    return own or (message.definition.unit if not field.source else None)
