"""Schema: the resolved ASN.1 modules of the standards, before the layout in bits.

A `Schema` contains `Module`s, a module contains `Definition`s in the order of its text, a definition contains a type.
Named types are references (`Reference`) until the layout follows them. The importer has replaced or removed:

- value references: replaced by their numbers;
- parameters: each instance is a definition of its own, named `<template>-<actual parameters>`;
- COMPONENTS OF: expanded;
- tags: alternatives of a CHOICE are in canonical order (X.680 8.6);
- comments, except units.

All constraints are kept, visible to PER or not, in the order and nesting of the text. A serial constraint and a union
have different meanings (X.680 50.11).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

# ---------------------------------------------------------------- constraints (X.680 clause 49 to 51)


class Range(NamedTuple):
    """Range that includes both ends; None is MIN or MAX. A single value is a range with equal ends."""

    low: int | None
    high: int | None


@dataclass(frozen=True, slots=True)
class Values:
    """Set of numbers: ranges in ascending order that neither overlap nor touch.

    Inside an Alphabet they are code points, for an ENUMERATED the numbers of its items, for a BOOLEAN 0 and 1.
    """

    ranges: tuple[Range, ...]


@dataclass(frozen=True, slots=True)
class Size:
    """SIZE of a string or list. within: constraint of the number of its units."""

    within: "Constraint"


@dataclass(frozen=True, slots=True)
class Alphabet:
    """FROM of a string. within: constraint of its characters, as code points."""

    within: "Constraint"


class InnerComponent(NamedTuple):
    """One line of WITH COMPONENTS. presence: "PRESENT", "ABSENT", "OPTIONAL", or None if not given."""

    name: str
    constraint: "Constraint | None"
    presence: str | None


@dataclass(frozen=True, slots=True)
class Inner:
    """WITH COMPONENTS {...}. partial: it begins with an ellipsis, so that other components remain unconstrained."""

    partial: bool
    components: tuple[InnerComponent, ...]


@dataclass(frozen=True, slots=True)
class Element:
    """WITH COMPONENT: a constraint of every element of a list."""

    constraint: "Constraint"


@dataclass(frozen=True, slots=True)
class Contents:
    """CONTAINING: the type whose encoding a string contains."""

    type: "Type"


@dataclass(frozen=True, slots=True)
class AnyOf:
    """A union (|) with a member other than numbers; a union of numbers is one `Values`."""

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
    """A constraint in parentheses: (root) or (root, ...) or (root, ..., additions)."""

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
    constraints: tuple[Constraint, ...] = ()  # serial constraints; that of the innermost parent comes first


@dataclass(frozen=True, slots=True)
class Boolean(_Type): ...


@dataclass(frozen=True, slots=True)
class Null(_Type): ...


@dataclass(frozen=True, slots=True)
class Integer(_Type):
    names: tuple[Named, ...] = ()


@dataclass(frozen=True, slots=True)
class Enumerated(_Type):
    """An ENUMERATED. root: sorted by value, as PER counts them (X.691 14.1); additions: in the order of the text."""

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
    """A character string. kind: its ASN.1 name, such as "IA5String", "UTF8String", "NumericString"."""

    kind: str


@dataclass(frozen=True, slots=True)
class ObjectIdentifier(_Type):
    is_relative: bool = False


Default = bool | int | str | bytes | tuple[bytes, int] | None
"""A DEFAULT, resolved: BOOLEAN, number, name of an enumeration item, OCTET STRING, (octets, bits) of a BIT STRING."""


@dataclass(frozen=True, slots=True)
class Component:
    """Component of a SEQUENCE, or alternative of a CHOICE.

    default  None: no DEFAULT. This is unambiguous, because no component with a DEFAULT is NULL.
    """

    name: str
    type: "Type"
    is_optional: bool = False
    default: Default = None
    unit: str | None = None  # only if its type has no unit


@dataclass(frozen=True, slots=True)
class Group:
    """Version brackets [[ ... ]]: one extension addition of several components. version: the number in [[ n: ]]."""

    components: tuple[Component, ...]
    version: int | None = None


@dataclass(frozen=True, slots=True)
class Sequence(_Type):
    """A SEQUENCE. PER encodes root and tail as one root.

    root  components before the first ellipsis.
    tail  components after the second ellipsis.
    """

    root: tuple[Component, ...]
    is_extensible: bool = False
    additions: tuple[Component | Group, ...] = ()
    tail: tuple[Component, ...] = ()


@dataclass(frozen=True, slots=True)
class Choice(_Type):
    """A CHOICE. root: alternatives in canonical order of their tags; additions: in the order of the text."""

    root: tuple[Component, ...]
    is_extensible: bool = False
    additions: tuple[Component | Group, ...] = ()


@dataclass(frozen=True, slots=True)
class SequenceOf(_Type):
    element: "Type"
    is_set: bool = False  # SET OF; UPER encodes it like SEQUENCE OF


@dataclass(frozen=True, slots=True)
class Reference(_Type):
    """Reference to a definition of this or another module. Its constraints apply after those of the definition."""

    module: str  # the key of Schema.modules
    name: str


@dataclass(frozen=True, slots=True)
class ClassField(_Type):
    """CLASS.&id ({set}). It is encoded as the identifier type of the class."""

    class_: Reference
    set_: Reference


@dataclass(frozen=True, slots=True)
class OpenType(_Type):
    """CLASS.&Type ({set}{@selector}): an open type. The component `selector` of the same SEQUENCE selects its type."""

    class_: Reference
    set_: Reference
    selector: str


Type = (
    Boolean | Null | Integer | Enumerated | BitString | OctetString | CharacterString | ObjectIdentifier
    | Sequence | Choice | SequenceOf | Reference | ClassField | OpenType
)  # fmt: skip


def with_constraints(type_: Type, more: tuple[Constraint, ...]) -> Type:
    """Return the type with further constraints after its own."""
    return replace(type_, constraints=(*type_.constraints, *more)) if more else type_


# ---------------------------------------------------------------- definitions and modules


@dataclass(frozen=True, slots=True)
class ObjectClass:
    """A class with two fields: an identifier of type `id_type`, and a type. Their names begin with &."""

    name: str
    id_field: str
    id_type: Type
    type_field: str


class ObjectRow(NamedTuple):
    """{type IDENTIFIED BY value}"""

    value: int
    type: Type


@dataclass(frozen=True, slots=True)
class ObjectSet:
    name: str
    class_: Reference
    rows: tuple[ObjectRow, ...] = ()
    is_extensible: bool = False


@dataclass(frozen=True, slots=True)
class Definition:
    """A named type. unit: unit of the value 1 as in the standard ("0.01 m/s"); None without one."""

    name: str
    type: Type
    unit: str | None = None


@dataclass(frozen=True, slots=True)
class Module:
    """One module of one edition of a standard.

    key       "<release>_<slug>", such as r1_cam, r2_cdd241, r1_dsrc: unique, used as prefix in C
    name      name of the module in its text
    oid       object identifier with normalised spacing, or ""
    standard  document and version: "ETSI EN 302 637-2 v1.4.1"
    source    name of the file with its text, without folder; sha256: digest of that file
    left_out  names of definitions in its text that the schema omits, because no message uses them
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

    name        unique: type and version of the document, such as "cam-1.4.1"
    type        name of the type in the station: "cam"
    release     1 or 2
    standard    document and version
    pdu         top-level type
    ids         values of messageID that announce it
    versions    values of protocolVersion that announce it
    btp_port    standard BTP-B port (TS 103 248)
    rank        preference among editions that all re-encode to the same octets; the smallest is preferred
    form_of     name of the message of which this is the -ext form, in which extension markers survive serial
                constraints (asn1/model/forms.py); "" for the strict form
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
    """Modules by key, and messages by name."""

    modules: Mapping[str, Module]
    messages: Mapping[str, Message]

    def resolve(self, reference: Reference) -> Definition:
        """Return the definition that a reference names. Raises KeyError for a missing one: a bug of the importer."""
        return self.modules[reference.module].definitions[reference.name]
