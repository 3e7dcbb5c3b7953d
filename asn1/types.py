"""The schema: what the ASN.1 modules of the standards say, resolved but not yet laid out in bits.

A `Schema` holds `Module`s, a module holds `Definition`s in the order of its text, a definition holds a type. Names of
types are references (`Reference`) until the layout follows them. What is gone: value references (their numbers stand in
place), parameters (each instance is a definition of its own, named `<template>-<actual parameters>`), COMPONENTS OF
(expanded), tags (alternatives of a CHOICE stand in canonical order, X.680 8.6), comments (but for units).

What is kept: every constraint, the PER-visible and the others, in the order and nesting of the text, because a serial
constraint means another thing than a union (X.680 50.11).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

# ---------------------------------------------------------------- constraints (X.680 clause 49 to 51)


class Range(NamedTuple):
    """Both ends belong to it; None is MIN or MAX. A single value is a range of one."""

    low: int | None
    high: int | None


@dataclass(frozen=True, slots=True)
class Values:
    """Numbers, or code points of characters inside an Alphabet: a union of ranges, ascending, none touching another.

    Of an ENUMERATED the numbers of its items, of a BOOLEAN 0 and 1.
    """

    ranges: tuple[Range, ...]


@dataclass(frozen=True, slots=True)
class Size:
    """SIZE (within): of a string or list; `within` is about numbers."""

    within: "Constraint"


@dataclass(frozen=True, slots=True)
class Alphabet:
    """FROM (within): the characters of a string, as code points."""

    within: "Constraint"


class InnerComponent(NamedTuple):
    """One line of WITH COMPONENTS: presence is "PRESENT", "ABSENT", "OPTIONAL" or None (nothing said)."""

    name: str
    constraint: "Constraint | None"
    presence: str | None


@dataclass(frozen=True, slots=True)
class Inner:
    """WITH COMPONENTS {...}; partial: it began with an ellipsis, so that what it does not name stays as it is."""

    partial: bool
    components: tuple[InnerComponent, ...]


@dataclass(frozen=True, slots=True)
class Element:
    """WITH COMPONENT: holds for every element of a list."""

    constraint: "Constraint"


@dataclass(frozen=True, slots=True)
class Contents:
    """CONTAINING: what a string carries, encoded."""

    type: "Type"


@dataclass(frozen=True, slots=True)
class AnyOf:
    """A union (|) of what is not all numbers; a union of numbers is one `Values`."""

    members: "tuple[ElementSet, ...]"


@dataclass(frozen=True, slots=True)
class AllOf:
    """An intersection (^)."""

    members: "tuple[ElementSet, ...]"


@dataclass(frozen=True, slots=True)
class AllExcept:
    """ALL EXCEPT."""

    member: "ElementSet"


ElementSet = Values | Size | Alphabet | Inner | Element | Contents | AnyOf | AllOf | AllExcept


@dataclass(frozen=True, slots=True)
class Constraint:
    """One pair of parentheses: (root) or (root, ...) or (root, ..., additions)."""

    root: ElementSet
    is_extensible: bool = False
    additions: ElementSet | None = None


# ---------------------------------------------------------------- types (X.680)


class Named(NamedTuple):
    """A named number, bit or enumeration item."""

    name: str
    value: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _Type:
    constraints: tuple[Constraint, ...] = ()  # serial, the innermost (parent's) first


@dataclass(frozen=True, slots=True)
class Boolean(_Type): ...


@dataclass(frozen=True, slots=True)
class Null(_Type): ...


@dataclass(frozen=True, slots=True)
class Integer(_Type):
    names: tuple[Named, ...] = ()


@dataclass(frozen=True, slots=True)
class Enumerated(_Type):
    """root: ascending by value, as PER counts them (X.691 14.1); additions: in the order of the text."""

    root: tuple[Named, ...]
    is_extensible: bool = False
    additions: tuple[Named, ...] = ()


@dataclass(frozen=True, slots=True)
class BitString(_Type):
    names: tuple[Named, ...] = ()


@dataclass(frozen=True, slots=True)
class OctetString(_Type): ...


@dataclass(frozen=True, slots=True)
class CharacterString(_Type):
    """kind: the ASN.1 name, as "IA5String", "UTF8String", "NumericString"."""

    kind: str


@dataclass(frozen=True, slots=True)
class ObjectIdentifier(_Type):
    is_relative: bool = False


Default = bool | int | str | bytes | tuple[bytes, int] | None
"""A DEFAULT, resolved: BOOLEAN, number, name of an enumeration item, OCTET STRING, (octets, bits) of a BIT STRING."""


@dataclass(frozen=True, slots=True)
class Component:
    """Of a SEQUENCE, or an alternative of a CHOICE. A default of None is no DEFAULT: nothing that has one is NULL."""

    name: str
    type: "Type"
    is_optional: bool = False
    default: Default = None
    unit: str | None = None  # where the component has one that its type has not


@dataclass(frozen=True, slots=True)
class Group:
    """[[ ... ]]: one extension addition made of several components; version: the number in [[ n: ]]."""

    components: tuple[Component, ...]
    version: int | None = None


@dataclass(frozen=True, slots=True)
class Sequence(_Type):
    """root: first root list, tail: the components after the second ellipsis; PER takes both as one root."""

    root: tuple[Component, ...]
    is_extensible: bool = False
    additions: tuple[Component | Group, ...] = ()
    tail: tuple[Component, ...] = ()


@dataclass(frozen=True, slots=True)
class Choice(_Type):
    """Alternatives of the root in canonical order of their tags; additions in the order of the text."""

    root: tuple[Component, ...]
    is_extensible: bool = False
    additions: tuple[Component | Group, ...] = ()


@dataclass(frozen=True, slots=True)
class SequenceOf(_Type):
    element: "Type"
    is_set: bool = False  # SET OF: UPER codes it as SEQUENCE OF


@dataclass(frozen=True, slots=True)
class Reference(_Type):
    """To a definition, in this module or another; constraints of the reference follow those of its target."""

    module: str  # the key of Schema.modules
    name: str


@dataclass(frozen=True, slots=True)
class ClassField(_Type):
    """CLASS.&id ({set}): on the wire the class's identifier type."""

    class_: Reference
    set_: Reference


@dataclass(frozen=True, slots=True)
class OpenType(_Type):
    """CLASS.&Type ({set}{@selector}): an open type whose type the component `selector` beside it tells."""

    class_: Reference
    set_: Reference
    selector: str


Type = (
    Boolean | Null | Integer | Enumerated | BitString | OctetString | CharacterString | ObjectIdentifier
    | Sequence | Choice | SequenceOf | Reference | ClassField | OpenType
)  # fmt: skip


def with_constraints(type_: Type, more: tuple[Constraint, ...]) -> Type:
    """The same type with these constraints behind its own."""
    return replace(type_, constraints=(*type_.constraints, *more)) if more else type_


# ---------------------------------------------------------------- definitions and modules


@dataclass(frozen=True, slots=True)
class ObjectClass:
    """A class of two fields: an identifier of type `id_type`, and a type. The names are those of its text, with &."""

    name: str
    id_field: str
    id_type: Type
    type_field: str


class Row(NamedTuple):
    """{type IDENTIFIED BY value}"""

    value: int
    type: Type


@dataclass(frozen=True, slots=True)
class ObjectSet:
    name: str
    class_: Reference
    rows: tuple[Row, ...] = ()
    is_extensible: bool = False


@dataclass(frozen=True, slots=True)
class Definition:
    """A named type. unit: as the standard says it, for a value of 1 ("0.01 m/s"); None where there is none."""

    name: str
    type: Type
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class Module:
    """One module of one edition of a standard.

    key       unique among all editions, a C prefix: "<release>_<slug>", as r1_cam, r2_cdd241, r1_dsrc
    name      of the module in its text
    oid       the text of its object identifier in normal spacing, or ""
    standard  document and version: "ETSI EN 302 637-2 v1.4.1"; of a definition: this and its name is its clause
    source    name of the file it came from, without folder; sha256 of that file's octets
    left_out  names that its text defines and the schema has not kept, because no message reaches them
    """

    key: str
    name: str
    oid: str
    standard: str
    source: str
    sha256: str
    definitions: Mapping[str, Definition] = field(default_factory=dict)
    classes: Mapping[str, ObjectClass] = field(default_factory=dict)
    sets: Mapping[str, ObjectSet] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Message:
    """A PDU of one edition.

    name        "cam-1.4.1": the station's word and the document's version; unique
    type        the station's word: "cam"
    release     1 or 2
    pdu         the top-level type
    ids         messageID values that announce it
    versions    protocolVersion values that announce it
    btp_port    standard BTP-B port (TS 103 248)
    rank        order of preference where several editions give the same octets back: smallest first
    form_of     name of the message of which this is the -ext form: the extension marker stays through serial
                constraints (asn1/forms.py); "" for the strict form
    """

    name: str
    type: str
    release: int
    standard: str
    pdu: Reference
    ids: tuple[int, ...]
    versions: tuple[int, ...]
    btp_port: int
    rank: int
    is_experimental: bool = False
    form_of: str = ""


@dataclass(frozen=True, slots=True)
class Schema:
    """modules: by key, messages: by name."""

    modules: Mapping[str, Module]
    messages: Mapping[str, Message]

    def resolve(self, reference: Reference) -> Definition:
        """The definition that a reference names. Raises KeyError where there is none: a bug of the importer."""
        return self.modules[reference.module].definitions[reference.name]
