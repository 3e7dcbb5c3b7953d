"""Nodes of a layout: the resolved types, and their order by containment."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from asn1.model.constraints import Bounds, Ranges
from asn1.model.types import Constraint, Default, Message, Named, Schema


class Kind(StrEnum):
    """Kind of a type in memory; the same as captain_kind in runtime.h."""

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


# Suffixes that generated code appends to the name of a type, for its table and functions.
SUFFIXES = ("_type", "_decode", "_encode", "_validate", "_read", "_write", "_check")


def type_name(c_name: str) -> str:
    """Return the C name of a type. It never equals the name of another type's table or function."""
    return f"{c_name}_" if c_name.endswith(SUFFIXES) else c_name


class LayoutError(ValueError):
    """A type without a layout, or that C cannot represent.

    c_name  C name of the type's node.
    reason  the error without this name.
    """

    def __init__(self, c_name: str, reason: str) -> None:
        super().__init__(f"{c_name}: {reason}")
        self.c_name = c_name
        self.reason = reason


@dataclass(eq=False, slots=True)
class Field:
    """A component of a SEQUENCE or an alternative of a CHOICE.

    checks        constraints for a validator, in addition to those of the node
    is_optional   it may be absent (OPTIONAL, DEFAULT, every extension addition); the C struct has has_<name> before it
    addition      0 in the root, k in the k-th extension addition; members of a group have the same k
    is_mandatory  for an addition without OPTIONAL: present whenever its group is
    is_pointer    it is stored behind a pointer
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

    c_name        module key, with name or path: name of the C struct, and stem of the names of its table and functions
    is_defined    True for a definition of its module, False for a type inside another type
    bounds        of the value (INTEGER) or of the size (strings, LIST)
    is_extensible the encoding has an extension bit
    names         INTEGER, bits: named numbers; ENUMERATED: the root in encoding order, then the additions
    root_count    number of names or fields in the root
    additions     number of known extension additions; a group counts as one
    rows          OPEN: identifiers with their types
    selector      OPEN: index of the neighbouring field with the identifier
    recurs        it contains itself
    is_entry      it is decoded by its own function: a PDU, a struct in a list, or a type of an object set
    form_of       type of which this is the -ext form (forms.py); both share one C struct
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
        """Name of the C struct."""
        return (self.form_of or self).c_name

    @property
    def size(self) -> int:
        """Size of a string of fixed size."""
        return self.bounds.low or 0

    @property
    def item(self) -> "Node":
        """Type of a list's elements. Raises TypeError for a node that is not a list."""
        if self.element is None:
            raise TypeError(f"{self.c_name} is not a list")
        return self.element

    @property
    def root(self) -> list[Field]:
        return [f for f in self.fields if not f.addition]

    def groups(self) -> list[list[Field]]:
        """Return the fields of each extension addition."""
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
    """Result of lay_out(). nodes: by module; a struct comes after those that it contains by value."""

    schema: Schema
    messages: tuple[Message, ...]
    pdus: dict[str, Node]
    nodes: dict[str, list[Node]]


# ---------------------------------------------------------------- order


def by_value_order(nodes: Sequence[Node]) -> list[Node]:
    """Return the nodes in an order in which each struct comes after those that it contains by value."""
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
    """Return a number for each node; nodes that reach each other have the same number (Tarjan)."""
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
