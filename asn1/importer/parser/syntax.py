"""Syntax tree of a module's text, before names are resolved."""

from collections.abc import Mapping
from dataclasses import dataclass

from asn1.importer.parser.fault import Place
from asn1.importer.parser.lexer import Token

# ---------------------------------------------------------------- values (X.680 clause 17)


@dataclass(frozen=True, slots=True)
class Number:
    place: Place
    value: int


@dataclass(frozen=True, slots=True)
class Word:
    """A value given by a name: value reference, named number, enumeration item, TRUE, FALSE, NULL, MIN or MAX."""

    place: Place
    name: str
    module: str | None = None


@dataclass(frozen=True, slots=True)
class Text:
    place: Place
    value: str


@dataclass(frozen=True, slots=True)
class Octets:
    """'0A'H, as its digits."""

    place: Place
    digits: str


@dataclass(frozen=True, slots=True)
class Bits:
    """'0101'B, as its digits."""

    place: Place
    digits: str


@dataclass(frozen=True, slots=True)
class Braces:
    """{ ... }, not parsed yet: its grammar depends on the type of the value."""

    place: Place
    inside: tuple[Token, ...]


Value = Number | Word | Text | Octets | Bits | Braces

# ---------------------------------------------------------------- constraints (X.680 clauses 49 to 51)


@dataclass(frozen=True, slots=True)
class Single:
    value: Value


@dataclass(frozen=True, slots=True)
class Between:
    """The range low .. high; excludes_low and excludes_high: low < .. < high."""

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
    """A type used as a constraint, with or without INCLUDES."""

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
    """Constraint `base EXCEPT without`. base: None means ALL."""

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
    """A tag. class_: UNIVERSAL, APPLICATION, PRIVATE, or "" for context-specific."""

    class_: str
    number: Value


@dataclass(frozen=True, slots=True)
class Item:
    """A named number, bit or enumeration item; value None if the text gives no number."""

    place: Place
    name: str
    value: Value | None


@dataclass(frozen=True, slots=True)
class Component:
    """A component. unit: from the comments before it; default: value of DEFAULT."""

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
    """Members of a SEQUENCE, SET or CHOICE.

    root       before the first ellipsis.
    additions  between the ellipses.
    tail       after the second ellipsis.
    """

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
    """A builtin type without further syntax: BOOLEAN, NULL, OCTET STRING, OBJECT IDENTIFIER, IA5String, ..."""

    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class WithItems(Type):
    """INTEGER or BIT STRING, with or without named items."""

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
    """SEQUENCE OF or SET OF. constraints: those written before OF, such as SIZE."""

    is_set: bool
    element: Type


@dataclass(frozen=True, slots=True, kw_only=True)
class Actual:
    """An actual parameter, parsed as type, value or object set, as its text allows. set_: name in {Name}."""

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
    """CLASS.&field, with its table constraint ({set}) or ({set}{@selector})."""

    class_: str
    field: str
    set_: str | None = None
    selector: str | None = None


# ---------------------------------------------------------------- assignments and modules


@dataclass(frozen=True, slots=True)
class Formal:
    """A formal parameter. governor: text before the colon, or ""."""

    name: str
    governor: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    place: Place
    name: str
    formals: tuple[Formal, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TypeAssignment(Assignment):
    """A type assignment. is_superseded: the standard has a replacement, and keeps this for compatibility only."""

    type: Type
    unit: str | None
    is_superseded: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueAssignment(Assignment):
    type: Type
    value: Value


@dataclass(frozen=True, slots=True, kw_only=True)
class SetAssignment(Assignment):
    """Name Governor ::= {...}: an object set or a value set."""

    governor: Type
    inside: tuple[Token, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassField:
    """A field of a class. type None: a type field, such as &Type."""

    place: Place
    name: str
    type: Type | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassAssignment(Assignment):
    """A class assignment. syntax: words and fields of WITH SYNTAX; empty without it."""

    fields: tuple[ClassField, ...]
    syntax: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Import:
    """An import. selection: SUCCESSORS or DESCENDANTS if later identifiers are accepted as well, else ""."""

    place: Place
    module: str
    oid: str
    names: tuple[str, ...]
    selection: str = ""


@dataclass(frozen=True, slots=True)
class Module:
    """A module. imports: by imported name; body: tokens of its assignments, to compare modules."""

    place: Place
    name: str
    oid: str
    automatic_tags: bool
    imports: Mapping[str, Import]
    assignments: Mapping[str, Assignment]
    body: tuple[str, ...]
