"""The syntax tree: what a module's text says, word for word, before any name is looked up."""

from collections.abc import Mapping
from dataclasses import dataclass

from asn1.importer.fault import Place
from asn1.importer.lexer import Token

# ---------------------------------------------------------------- values (X.680 clause 17)


@dataclass(frozen=True, slots=True)
class Number:
    place: Place
    value: int


@dataclass(frozen=True, slots=True)
class Word:
    """A value reference, a named number, an enumeration item, TRUE, FALSE, NULL, MIN or MAX."""

    place: Place
    name: str
    module: str | None = None


@dataclass(frozen=True, slots=True)
class Text:
    place: Place
    value: str


@dataclass(frozen=True, slots=True)
class Octets:
    """'0A'H, as the digits."""

    place: Place
    digits: str


@dataclass(frozen=True, slots=True)
class Bits:
    """'0101'B, as the digits."""

    place: Place
    digits: str


@dataclass(frozen=True, slots=True)
class Braces:
    """{ ... }: what it means depends on what it is a value of."""

    place: Place
    inside: tuple[Token, ...]


Value = Number | Word | Text | Octets | Bits | Braces

# ---------------------------------------------------------------- constraints (X.680 clauses 49 to 51)


@dataclass(frozen=True, slots=True)
class Single:
    value: Value


@dataclass(frozen=True, slots=True)
class Between:
    """low .. high; excludes_low, excludes_high: low < .. < high."""

    low: Value
    high: Value
    excludes_low: bool = False
    excludes_high: bool = False


@dataclass(frozen=True, slots=True)
class SizeOf:
    place: Place
    constraint: "Constraint"


@dataclass(frozen=True, slots=True)
class From:
    place: Place
    constraint: "Constraint"


@dataclass(frozen=True, slots=True)
class With:
    """WITH COMPONENT."""

    place: Place
    constraint: "Constraint"


@dataclass(frozen=True, slots=True)
class WithLine:
    place: Place
    name: str
    constraint: "Constraint | None"
    presence: str | None


@dataclass(frozen=True, slots=True)
class WithAll:
    """WITH COMPONENTS."""

    place: Place
    partial: bool
    lines: tuple[WithLine, ...]


@dataclass(frozen=True, slots=True)
class Containing:
    place: Place
    type: "Type"


@dataclass(frozen=True, slots=True)
class Included:
    """A type in a constraint, with or without INCLUDES."""

    place: Place
    type: "Type"


@dataclass(frozen=True, slots=True)
class Union:
    members: "tuple[Elements, ...]"


@dataclass(frozen=True, slots=True)
class Intersection:
    members: "tuple[Elements, ...]"


@dataclass(frozen=True, slots=True)
class Except:
    """base EXCEPT without; base None: ALL."""

    place: Place
    base: "Elements | None"
    without: "Elements"


Elements = Single | Between | SizeOf | From | With | WithAll | Containing | Included | Union | Intersection | Except


@dataclass(frozen=True, slots=True)
class Constraint:
    place: Place
    root: Elements
    is_extensible: bool = False
    additions: Elements | None = None


# ---------------------------------------------------------------- types


@dataclass(frozen=True, slots=True)
class Tag:
    """class_: UNIVERSAL, APPLICATION, "" (context) or PRIVATE."""

    class_: str
    number: Value


@dataclass(frozen=True, slots=True)
class Item:
    """A named number, bit or enumeration item; value None where the text numbers none."""

    place: Place
    name: str
    value: Value | None


@dataclass(frozen=True, slots=True)
class Component:
    """unit: of its comments. default: a value."""

    place: Place
    name: str
    type: "Type"
    is_optional: bool
    default: Value | None
    unit: str | None


@dataclass(frozen=True, slots=True)
class ComponentsOf:
    place: Place
    type: "Type"


@dataclass(frozen=True, slots=True)
class Group:
    place: Place
    components: "tuple[Component | ComponentsOf, ...]"
    version: int | None


Member = Component | ComponentsOf | Group


@dataclass(frozen=True, slots=True)
class Members:
    """Of a SEQUENCE, SET or CHOICE: in front of, between and behind the ellipses."""

    root: tuple[Component | ComponentsOf, ...]
    is_extensible: bool
    additions: tuple[Member, ...]
    tail: tuple[Component | ComponentsOf, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Type:
    place: Place
    constraints: tuple[Constraint, ...] = ()
    tag: Tag | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Plain(Type):
    """A builtin type whose name says it all: BOOLEAN, NULL, OCTET STRING, OBJECT IDENTIFIER, IA5String, ..."""

    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class WithItems(Type):
    """INTEGER or BIT STRING, with names or without."""

    name: str
    items: tuple[Item, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Enumerated(Type):
    root: tuple[Item, ...]
    is_extensible: bool
    additions: tuple[Item, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Structure(Type):
    """SEQUENCE, SET or CHOICE."""

    name: str
    members: Members


@dataclass(frozen=True, slots=True, kw_only=True)
class ListOf(Type):
    """SEQUENCE OF or SET OF; the constraints are those in front of OF."""

    is_set: bool
    element: Type


@dataclass(frozen=True, slots=True, kw_only=True)
class Actual:
    """An actual parameter: whichever of the three its text can be. set_: name of an object set, given as {Name}."""

    place: Place
    text: str
    type: Type | None = None
    value: Value | None = None
    set_: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference(Type):
    name: str
    module: str | None = None
    actuals: tuple[Actual, ...] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldOf(Type):
    """CLASS.&field, and its table constraint ({set}) or ({set}{@selector})."""

    class_: str
    field: str
    set_: str | None = None
    selector: str | None = None


# ---------------------------------------------------------------- assignments and modules


@dataclass(frozen=True, slots=True)
class Formal:
    """A formal parameter; governor: text of what stands in front of the colon, "" where nothing does."""

    name: str
    governor: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    place: Place
    name: str
    formals: tuple[Formal, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeAssignment(Assignment):
    """is_superseded: the standard has another type in its place, and keeps it for old users."""

    type: Type
    unit: str | None
    is_superseded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueAssignment(Assignment):
    type: Type
    value: Value


@dataclass(frozen=True, slots=True, kw_only=True)
class SetAssignment(Assignment):
    """Name Governor ::= {...}: an object set, or a value set."""

    governor: Type
    inside: tuple[Token, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassField:
    """Of a class; type None: &Type, a type field."""

    place: Place
    name: str
    type: Type | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassAssignment(Assignment):
    """syntax: the words and fields of WITH SYNTAX; empty where there is none."""

    fields: tuple[ClassField, ...]
    syntax: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Import:
    """selection: SUCCESSORS or DESCENDANTS of the identifier are taken as well; "" for neither."""

    place: Place
    module: str
    oid: str
    names: tuple[str, ...]
    selection: str = ""


@dataclass(frozen=True, slots=True)
class Module:
    """imports: by the name imported. body: the words of the assignments, for whoever compares texts."""

    place: Place
    name: str
    oid: str
    automatic_tags: bool
    imports: Mapping[str, Import]
    assignments: Mapping[str, Assignment]
    body: tuple[str, ...]
