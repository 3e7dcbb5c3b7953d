"""Wording of types and constraints, for pages."""

from collections.abc import Callable

from asn1.model.types import (
    AllExcept,
    AllOf,
    Alphabet,
    AnyOf,
    BitString,
    Boolean,
    CharacterString,
    Choice,
    ClassField,
    Component,
    Constraint,
    Contents,
    Element,
    ElementSet,
    Enumerated,
    Inner,
    Integer,
    Null,
    ObjectIdentifier,
    OctetString,
    OpenType,
    Range,
    Reference,
    Schema,
    Sequence,
    SequenceOf,
    Size,
    Type,
    Values,
)

NAMES: dict[type, str] = {
    Boolean: "BOOLEAN",
    Null: "NULL",
    Integer: "INTEGER",
    Enumerated: "ENUMERATED",
    BitString: "BIT STRING",
    OctetString: "OCTET STRING",
    Sequence: "SEQUENCE",
    Choice: "CHOICE",
    OpenType: "open type",
    ClassField: "identifier",
}


def type_name(type_: Type, name_of: Callable[[Reference], str]) -> str:
    """Return the kind of a type. name_of: returns the text for a reference."""
    match type_:
        case Reference():
            return name_of(type_)
        case SequenceOf():
            return f"{'SET' if type_.is_set else 'SEQUENCE'} OF {type_name(type_.element, name_of)}"
        case CharacterString():
            return type_.kind
        case ObjectIdentifier():
            return "RELATIVE-OID" if type_.is_relative else "OBJECT IDENTIFIER"
        case _:
            return NAMES[type(type_)]


def bounds(schema: Schema, type_: Type) -> str:
    """Return the allowed values of a type, including constraints of its referenced types.

    Examples: "0..16383", "size 1..7, extensible".
    """
    shown: dict[object, str] = {}
    for constraint in _chain(schema, type_):
        # A serial constraint narrows its parent (X.680 50.11), so the last one of each kind is sufficient.
        kind: object = type(constraint.root)
        if kind in (AnyOf, AllOf, AllExcept, Inner, Element):
            kind = constraint
        shown.pop(kind, None)
        shown[kind] = constraint_text(constraint)
    return "; ".join(shown.values())


def unit_of(schema: Schema, type_: Type) -> str | None:
    """Return the unit of the nearest definition that has one."""
    while isinstance(type_, Reference):
        definition = schema.resolve(type_)
        if definition.unit:
            return definition.unit
        type_ = definition.type
    return None


def constraint_text(constraint: Constraint) -> str:
    text = _set_text(constraint.root)
    if constraint.additions is not None:
        return f"{text}, later also {_set_text(constraint.additions)}"
    return f"{text}, extensible" if constraint.is_extensible else text


def presence(component: Component, addition: int | None) -> str:
    """Return the presence of a component of a SEQUENCE.

    addition  number of its extension addition, from 1; None in the root.
    """
    if component.default is not None:
        text = f"default {default_text(component.default)}"
    elif component.is_optional:
        text = "optional"
    else:
        text = "always" if addition is None else ""
    if addition is None:
        return text
    return f"extension {addition}" + (f", {text}" if text else "")


def default_text(value: object) -> str:
    match value:
        case bool():
            return str(value).upper()
        case bytes():
            return f"0x{value.hex()}" if value else "empty"
        case (bytes() as octets, int(bits)):
            return f"0x{octets.hex()} ({bits} bits)" if bits else "empty"
        case _:
            return str(value)


def _chain(schema: Schema, type_: Type) -> tuple[Constraint, ...]:
    """Return the serial constraints of a type; those of its referenced types come first."""
    if isinstance(type_, Reference):
        return _chain(schema, schema.resolve(type_).type) + type_.constraints
    return type_.constraints


def _set_text(elements: ElementSet) -> str:
    match elements:
        case Values(ranges):
            return ", ".join(map(_range_text, ranges))
        case Size(within):
            return f"size {constraint_text(within)}"
        case Alphabet(within):
            return f"characters {_characters(within.root)}"
        case Inner(partial, components):
            rows = [_inner(row.name, row.constraint, row.presence) for row in components]
            return ("" if partial else "only ") + ", ".join(rows)
        case Element(constraint):
            return f"each {constraint_text(constraint)}"
        case Contents():
            return "contains an encoded value"
        case AnyOf(members):
            return " or ".join(f"({_set_text(member)})" for member in members)
        case AllOf(members):
            return " and ".join(f"({_set_text(member)})" for member in members)
        case AllExcept(member):
            return f"all but ({_set_text(member)})"


def _range_text(bounds_: Range) -> str:
    low = "MIN" if bounds_.low is None else str(bounds_.low)
    high = "MAX" if bounds_.high is None else str(bounds_.high)
    return low if low == high else f"{low}..{high}"


def _characters(elements: ElementSet) -> str:
    if not isinstance(elements, Values):
        return _set_text(elements)
    ends = [(row.low or 0, 0x10FFFF if row.high is None else row.high) for row in elements.ranges]
    return ", ".join(repr(chr(low)) if low == high else f"{chr(low)!r}..{chr(high)!r}" for low, high in ends)


def _inner(name: str, constraint: Constraint | None, presence_: str | None) -> str:
    words = [f"`{name}`"]
    if presence_ is not None:
        words.append(presence_.lower())
    if constraint is not None:
        words.append(f"({constraint_text(constraint)})")
    return " ".join(words)
