"""The types of a layout: what they are, and the order in which they hold each other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from asn1.constraints import Bounds, Ranges
from asn1.types import Constraint, Default, Message, Named, Schema


class Kind(StrEnum):
    """As captain_kind in runtime.h."""

    BOOLEAN = "BOOLEAN"
    NULL = "NULL"
    INTEGER = "INTEGER"
    ENUMERATED = "ENUMERATED"
    SMALL_BITS = "SMALL_BITS"
    BIT_STRING = "BIT_STRING"
    FIXED_OCTETS = "FIXED_OCTETS"
    OCTET_STRING = "OCTET_STRING"
    IA5 = "IA5"
    VISIBLE = "VISIBLE"
    PRINTABLE = "PRINTABLE"
    NUMERIC = "NUMERIC"
    UTF8 = "UTF8"
    OID = "OID"
    RELATIVE_OID = "RELATIVE_OID"
    SEQUENCE = "SEQUENCE"
    CHOICE = "CHOICE"
    LIST = "LIST"
    OPEN = "OPEN"


STRUCTS = frozenset({Kind.SEQUENCE, Kind.CHOICE, Kind.LIST})


# What generated code puts behind the name of a type: its table, its functions.
SUFFIXES = ("_type", "_decode", "_encode", "_validate", "_read", "_write", "_check")


def type_name(c_name: str) -> str:
    """The C name of a type: never that of the table or of a function of another."""
    return f"{c_name}_" if c_name.endswith(SUFFIXES) else c_name


class LayoutError(ValueError):
    """A type that cannot be laid out, or not said in C. c_name: as that of its node; reason: without it."""

    def __init__(self, c_name: str, reason: str) -> None:
        super().__init__(f"{c_name}: {reason}")
        self.c_name = c_name
        self.reason = reason


@dataclass(eq=False, slots=True)
class Field:
    """A component of a SEQUENCE or an alternative of a CHOICE.

    is_optional   it may be absent: has_<name> stands in front of it (OPTIONAL, DEFAULT, every extension addition)
    addition      0 in the root, k for the k-th extension addition (the members of a group share it)
    is_mandatory  of an addition: not OPTIONAL in the text, so there whenever its group is
    """

    name: str
    node: "Node"
    checks: tuple[Constraint, ...] = ()
    is_optional: bool = False
    default: Default = None
    unit: str | None = None
    addition: int = 0
    in_group: bool = False
    is_mandatory: bool = False
    is_pointer: bool = False


@dataclass(eq=False, slots=True)
class Node:
    """A type.

    c_name        module key and name or path: the C type of structs, and the stem of its table's and functions' names
    is_defined    it is a definition of its module; else it stands inside another type
    bounds        of the value (INTEGER) or of the size (strings, LIST)
    is_extensible the encoding has an extension bit
    names         INTEGER, bits: named numbers; ENUMERATED: the root in encoding order, then the additions
    root_count    of names or fields: those of the root
    additions     extension additions known, a group counts once
    selector      OPEN: index of the field beside it that holds the identifier
    recurs        it contains itself
    is_entry      a PDU, a struct in a list, or what stands in an object set: never a part of what holds it
    form_of       the type of which this is the -ext form (forms.py): both have one C struct
    """

    kind: Kind
    module: str
    c_name: str
    asn_name: str | None = None
    is_defined: bool = False
    unit: str | None = None
    standard: str | None = None
    constraints: tuple[Constraint, ...] = ()
    bounds: Bounds = field(default_factory=lambda: Bounds(None, None))
    is_extensible: bool = False
    alphabet: Ranges | None = None
    names: tuple[Named, ...] = ()
    root_count: int = 0
    fields: list[Field] = field(default_factory=list)
    additions: int = 0
    element: "Node | None" = None
    element_checks: tuple[Constraint, ...] = ()
    rows: list[tuple[int, "Node"]] = field(default_factory=list)
    selector: int = 0
    recurs: bool = False
    is_entry: bool = False
    form_of: "Node | None" = None

    @property
    def struct_name(self) -> str:
        """The C type of a struct."""
        return (self.form_of or self).c_name

    @property
    def size(self) -> int:
        """The one size of a string of fixed size."""
        return self.bounds.low or 0

    @property
    def item(self) -> "Node":
        if self.element is None:
            raise TypeError(f"{self.c_name} is no list")
        return self.element

    @property
    def root(self) -> list[Field]:
        return [f for f in self.fields if not f.addition]

    def groups(self) -> list[list[Field]]:
        """The fields of each extension addition."""
        return [[f for f in self.fields if f.addition == k] for k in range(1, self.additions + 1)]

    def children(self) -> Iterator["Node"]:
        for f in self.fields:
            yield f.node
        if self.element is not None:
            yield self.element
        for _, node in self.rows:
            yield node


@dataclass(frozen=True, slots=True)
class Layout:
    """nodes: of each module, those that hold others behind those they hold, where they lie in them by value."""

    schema: Schema
    messages: tuple[Message, ...]
    pdus: dict[str, Node]
    nodes: dict[str, list[Node]]


# ---------------------------------------------------------------- order


def by_value_order(nodes: Sequence[Node]) -> list[Node]:
    """A struct comes behind those that lie in it."""
    done: dict[Node, None] = {}

    def visit(node: Node) -> None:
        if node in done:
            return
        for f in node.fields:
            if not f.is_pointer:
                visit(f.node)
        done[node] = None

    for node in nodes:
        visit(node)
    return list(done)


def strong_components(nodes: Sequence[Node]) -> dict[Node, int]:
    """Tarjan: nodes that reach each other have the same number."""
    index: dict[Node, int] = {}
    low: dict[Node, int] = {}
    stack: list[Node] = []
    component: dict[Node, int] = {}

    def visit(node: Node) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for child in node.children():
            if child not in index:
                visit(child)
                low[node] = min(low[node], low[child])
            elif child not in component:
                low[node] = min(low[node], index[child])
        if low[node] == index[node]:
            while True:
                top = stack.pop()
                component[top] = index[node]
                if top is node:
                    break

    for node in nodes:
        if node not in index:
            visit(node)
    return component
