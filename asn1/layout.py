"""Layout: the schema's types resolved, each with its bounds, its bits and its place in memory.

`lay_out` follows every reference from the messages chosen and makes one `Node` per type that is met: one for each definition
reached, one for each type inside a type, and one for each reference that is constrained further in a way that the encoding
sees. A reference to a SEQUENCE or CHOICE that is constrained further keeps the node it refers to: its encoding is the same,
and what a validator has to look at stands in `Field.checks`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from asn1 import constraints as sets
from asn1.constraints import Bounds, Ranges
from asn1.types import (
    BitString, Boolean, CharacterString, Choice, ClassField, Component, Constraint, Default, Enumerated, Group, Integer,
    Message, Named, Null, ObjectIdentifier, OctetString, OpenType, Reference, Schema, SequenceOf, Type,
)  # fmt: skip
from asn1.types import Sequence as SequenceType

# A component that may be absent, or is one of several, lies behind a pointer where its struct is larger (octets).
INLINE_MAX = 128
# Fixed BIT STRINGs up to this many bits are numbers, fixed OCTET STRINGs up to this many octets are arrays.
SMALL_MAX = 64


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


TEXTS = {
    "IA5String": Kind.IA5,
    "VisibleString": Kind.VISIBLE,
    "ISO646String": Kind.VISIBLE,
    "PrintableString": Kind.PRINTABLE,
    "NumericString": Kind.NUMERIC,
    "UTF8String": Kind.UTF8,
}
STRUCTS = frozenset({Kind.SEQUENCE, Kind.CHOICE, Kind.LIST})


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
    is_entry      a PDU, or what stands in an object set: read and written by itself
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


def lay_out(schema: Schema, messages: Sequence[Message]) -> Layout:
    """All types that the messages reach. Raises ValueError where constraints leave nothing, KeyError for a lost reference."""
    builder = _Builder(schema)
    pdus = {}
    for message in messages:
        pdus[message.name] = builder.definition(message.pdu)
        pdus[message.name].is_entry = True
    builder.finish()
    nodes: dict[str, list[Node]] = {}
    for node in _by_value_order(builder.made):
        nodes.setdefault(node.module, []).append(node)
    return Layout(schema, tuple(messages), pdus, nodes)


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a type stands: what its node is called."""

    module: str
    c_name: str
    asn_name: str | None = None
    unit: str | None = None
    standard: str | None = None

    def inside(self, name: str) -> "_Place":
        return _Place(self.module, f"{self.c_name}_{name.replace('-', '_')}")


class _Builder:
    def __init__(self, schema: Schema) -> None:
        self.schema = schema
        self.made: list[Node] = []
        self.defined: dict[tuple[str, str], Node] = {}
        self.taken = {
            f"{key}_{name.replace('-', '_')}" for key, module in schema.modules.items() for name in module.definitions
        }

    def definition(self, reference: Reference) -> Node:
        known = self.defined.get((reference.module, reference.name))
        if known is not None:
            return known
        module = self.schema.modules[reference.module]
        c_name = f"{module.key}_{reference.name.replace('-', '_')}"
        _, _, named = self.base(reference)
        place = _Place(module.key, c_name, reference.name, named.unit, module.standard)
        type_, constraints, _ = self.base(self.schema.resolve(reference).type)
        node = Node(Kind.NULL, module.key, c_name, is_defined=True)
        self.defined[reference.module, reference.name] = node
        self.fill(node, type_, constraints, place)
        return node

    def base(self, type_: Type) -> tuple[Type, tuple[Constraint, ...], _Place]:
        """Behind all references: the type, all constraints in serial order, and the names that the references gave."""
        constraints = type_.constraints
        place = _Place("", "")
        while isinstance(type_, Reference | ClassField):
            if isinstance(type_, ClassField):
                type_ = self.schema.modules[type_.class_.module].classes[type_.class_.name].id_type
                constraints = (*type_.constraints, sets.TABLE, *constraints)
                continue
            found = self.schema.resolve(type_)
            place = _Place(
                place.module or type_.module,
                "",
                place.asn_name or type_.name,
                place.unit or found.unit,
                place.standard or self.schema.modules[type_.module].standard,
            )
            type_ = found.type
            constraints = (*type_.constraints, *constraints)
        return type_, constraints, place

    def node(self, type_: Type, place: _Place) -> tuple[Node, tuple[Constraint, ...]]:
        """The node of a type that stands at a place, and what a validator has to check there beyond it."""
        if isinstance(type_, Reference):
            if not type_.constraints:
                return self.definition(type_), ()
            bottom, _, _ = self.base(type_)
            if isinstance(bottom, SequenceType | Choice):
                return self.definition(type_), type_.constraints
        bottom, constraints, named = self.base(type_)
        c_name = place.c_name
        while c_name in self.taken:
            c_name += "_"
        self.taken.add(c_name)
        node = Node(Kind.NULL, place.module, c_name)
        self.fill(node, bottom, constraints, _Place(place.module, c_name, named.asn_name, named.unit, named.standard))
        return node, ()

    def fill(self, node: Node, type_: Type, constraints: tuple[Constraint, ...], place: _Place) -> None:
        node.asn_name, node.unit, node.standard = place.asn_name, place.unit, place.standard
        node.constraints = constraints
        self.made.append(node)
        try:
            self.fill_kind(node, type_, place)
        except ValueError as error:
            raise ValueError(f"{node.c_name}: {error}") from None

    def fill_kind(self, node: Node, type_: Type, place: _Place) -> None:
        match type_:
            case Boolean():
                node.kind = Kind.BOOLEAN
            case Null():
                node.kind = Kind.NULL
            case Integer():
                node.kind, node.names = Kind.INTEGER, type_.names
                node.bounds = sets.value_bounds(node.constraints)
            case Enumerated():
                node.kind, node.names = Kind.ENUMERATED, (*type_.root, *type_.additions)
                node.root_count, node.is_extensible = len(type_.root), type_.is_extensible
                return
            case BitString():
                node.bounds = sets.size_bounds(node.constraints)
                node.kind = Kind.SMALL_BITS if _is_small(node.bounds) else Kind.BIT_STRING
                node.names = type_.names
            case OctetString():
                node.bounds = sets.size_bounds(node.constraints)
                node.kind = Kind.FIXED_OCTETS if _is_small(node.bounds) else Kind.OCTET_STRING
            case CharacterString():
                node.kind = TEXTS[type_.kind]
                node.bounds = sets.size_bounds(node.constraints)
                node.alphabet = sets.alphabet(node.constraints, type_.kind)
            case ObjectIdentifier():
                node.kind = Kind.RELATIVE_OID if type_.is_relative else Kind.OID
            case SequenceOf():
                node.kind, node.bounds = Kind.LIST, sets.size_bounds(node.constraints)
                node.element, node.element_checks = self.node(type_.element, place.inside("item"))
            case SequenceType():
                self.fill_sequence(node, type_, place)
                return
            case Choice():
                self.fill_choice(node, type_, place)
                return
            case OpenType():
                node.kind = Kind.OPEN
                for row in self.schema.modules[type_.set_.module].sets[type_.set_.name].rows:
                    node.rows.append((row.value, self.node(row.type, place.inside(str(row.value)))[0]))
                    node.rows[-1][1].is_entry = True
                node.rows.sort(key=lambda row: row[0])
            case _:
                raise TypeError(f"{node.c_name}: {type(type_).__name__} cannot be laid out")
        node.is_extensible = node.bounds.is_extensible and node.kind is not Kind.UTF8

    def fill_sequence(self, node: Node, type_: SequenceType, place: _Place) -> None:
        node.kind, node.is_extensible, node.additions = Kind.SEQUENCE, type_.is_extensible, len(type_.additions)
        selectors = []
        for component in (*type_.root, *type_.tail):
            node.fields.append(self.field(component, place))
            selectors.append(component)
        node.root_count = len(node.fields)
        for k, addition in enumerate(type_.additions, 1):
            in_group = isinstance(addition, Group)
            for component in addition.components if isinstance(addition, Group) else (addition,):
                made = self.field(component, place)
                made.is_mandatory = not made.is_optional
                made.addition, made.in_group, made.is_optional = k, in_group, True
                node.fields.append(made)
                selectors.append(component)
        places = {component.name: index for index, component in enumerate(selectors)}
        for component, made in zip(selectors, node.fields, strict=True):
            if isinstance(component.type, OpenType):
                made.node.selector = places[component.type.selector]

    def fill_choice(self, node: Node, type_: Choice, place: _Place) -> None:
        node.kind, node.is_extensible = Kind.CHOICE, type_.is_extensible
        node.fields = [self.field(component, place) for component in type_.root]
        node.root_count = len(node.fields)
        for addition in type_.additions:
            # The brackets of a version do not count in a CHOICE: each alternative has its own index (X.680 29.1).
            for component in addition.components if isinstance(addition, Group) else (addition,):
                node.additions += 1
                made = self.field(component, place)
                made.addition = node.additions
                node.fields.append(made)

    def field(self, component: Component, place: _Place) -> Field:
        node, checks = self.node(component.type, place.inside(component.name))
        is_optional = component.is_optional or component.default is not None
        return Field(component.name, node, checks, is_optional, component.default, component.unit)

    def finish(self) -> None:
        """Who recurs, and what lies behind a pointer for it or for its size."""
        component_of = _strong_components(self.made)
        for node in self.made:
            node.recurs = any(component_of[child] == component_of[node] for child in node.children())
        for node in self.made:
            for f in node.fields:
                if f.node.kind in STRUCTS and component_of[f.node] == component_of[node]:
                    f.is_pointer = True
        known: dict[Node, tuple[int, int]] = {}
        for node in self.made:
            measure(node, known)


def _is_small(bounds: Bounds) -> bool:
    return bounds.low == bounds.high and not bounds.is_extensible and 1 <= (bounds.low or 0) <= SMALL_MAX


# ---------------------------------------------------------------- memory


def number_octets(node: Node) -> tuple[int, bool]:
    """Of an INTEGER or a small BIT STRING in memory: octets, and whether it is signed."""
    if node.kind is Kind.SMALL_BITS:
        return next(w for w in (1, 2, 4, 8) if node.size <= 8 * w), False
    low, high = node.bounds.low, node.bounds.high
    if low is None or high is None or node.is_extensible:
        return 8, True
    is_signed = low < 0
    for octets in (1, 2, 4, 8):
        bits = 8 * octets
        least, most = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if is_signed else (0, (1 << bits) - 1)
        if least <= low and high <= most:
            return octets, is_signed
    raise ValueError(f"{node.c_name}: {low}..{high} is wider than 64 bits")


def measure(node: Node, known: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    """(octets, alignment) where pointers have 8 octets. Decides which fields lie behind a pointer, on every machine alike."""
    if node not in known:
        match node.kind:
            case Kind.BOOLEAN | Kind.NULL:
                known[node] = (1, 1)
            case Kind.INTEGER | Kind.SMALL_BITS:
                octets, _ = number_octets(node)
                known[node] = (octets, octets)
            case Kind.ENUMERATED:
                known[node] = (4, 4)
            case Kind.FIXED_OCTETS:
                known[node] = (node.size, 1)
            case Kind.OPEN:
                known[node] = (32, 8)
            case Kind.SEQUENCE:
                known[node] = _measure_sequence(node, known)
            case Kind.CHOICE:
                known[node] = _measure_choice(node, known)
            case _:
                known[node] = (16, 8)
    return known[node]


def _measure_field(node: Node, f: Field, known: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    if not f.is_pointer:
        size, align = measure(f.node, known)
        f.is_pointer = f.node.kind in STRUCTS and size > INLINE_MAX and (f.is_optional or node.kind is Kind.CHOICE)
        if not f.is_pointer:
            return size, align
    return 8, 8


def _measure_sequence(node: Node, known: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    size, align = 0, 1
    for f in node.fields:
        size += f.is_optional
        field_size, field_align = _measure_field(node, f, known)
        size = _up(size, field_align) + field_size
        align = max(align, field_align)
    if node.is_extensible:
        size, align = _up(size, 8) + 8, 8
    return max(1, _up(size, align)), align


def _measure_choice(node: Node, known: dict[Node, tuple[int, int]]) -> tuple[int, int]:
    size, align = (16, 8) if node.is_extensible else (0, 4)
    for f in node.fields:
        field_size, field_align = _measure_field(node, f, known)
        size, align = max(size, field_size), max(align, field_align)
    return _up(_up(4, align) + size, align), align


def _up(size: int, align: int) -> int:
    return (size + align - 1) // align * align


# ---------------------------------------------------------------- order


def _by_value_order(nodes: Sequence[Node]) -> list[Node]:
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


def _strong_components(nodes: Sequence[Node]) -> dict[Node, int]:
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


# ---------------------------------------------------------------- bits


def count_width(bounds: Bounds) -> int | None:
    """Bits of a constrained length (X.691 11.9.4.1); None for a general one: no upper bound, or one of 64K and more."""
    return bounds.width if bounds.high is not None and bounds.high < 65536 else None


def unit_bits(node: Node) -> int:
    """Of a character of a known-multiplier string (X.691 30.5.2), an octet or a bit."""
    match node.kind:
        case Kind.BIT_STRING | Kind.SMALL_BITS:
            return 1
        case Kind.IA5 | Kind.VISIBLE | Kind.PRINTABLE | Kind.NUMERIC:
            if node.alphabet is not None:
                return (sets.count(node.alphabet) - 1).bit_length()
            return 4 if node.kind is Kind.NUMERIC else 7
        case _:
            return 8


# A SEQUENCE that always looks the same is read and written as part of what holds it, up to this many values.
FLAT_MAX = 8


def is_flat(node: Node) -> bool:
    """A small SEQUENCE of numbers only: no optional component, no extension, no length."""
    return node.kind is Kind.SEQUENCE and 0 < _flat_values(node) <= FLAT_MAX


def _flat_values(node: Node) -> int:
    """How many numbers it holds; more than FLAT_MAX where it is not flat."""
    if node.kind in (Kind.BOOLEAN, Kind.SMALL_BITS):
        return 1
    if node.kind is Kind.INTEGER and node.bounds.width is not None and not node.is_extensible:
        return 1
    if node.kind is Kind.ENUMERATED and not node.is_extensible:
        return 1
    if node.kind is not Kind.SEQUENCE or node.is_extensible or node.recurs or any(f.is_optional for f in node.fields):
        return FLAT_MAX + 1
    return sum(_flat_values(f.node) for f in node.fields)


def minimal_bits(node: Node, known: dict[Node, int]) -> int:
    """No value of the type takes fewer bits. A type inside itself counts as nothing there."""
    if node not in known:
        known[node] = 0
        known[node] = _minimal_bits(node, known)
    return known[node]


def _minimal_bits(node: Node, known: dict[Node, int]) -> int:
    match node.kind:
        case Kind.BOOLEAN:
            return 1
        case Kind.NULL:
            return 0
        case Kind.INTEGER:
            return node.is_extensible + min(16, node.bounds.width if node.bounds.width is not None else 16)
        case Kind.ENUMERATED:
            width = (node.root_count - 1).bit_length()
            return 1 + min(width, 7) if node.is_extensible else width
        case Kind.UTF8 | Kind.OID | Kind.RELATIVE_OID | Kind.OPEN:
            return 8
        case Kind.SEQUENCE:
            inside = sum(1 if f.is_optional else minimal_bits(f.node, known) for f in node.root)
            return node.is_extensible + inside
        case Kind.CHOICE:
            inside = min((minimal_bits(f.node, known) for f in node.root), default=0)
            width = (node.root_count - 1).bit_length() + inside
            return 1 + min(width, 15) if node.is_extensible else width
        case _:
            each = minimal_bits(node.item, known) if node.kind is Kind.LIST else unit_bits(node)
            width = count_width(node.bounds)
            root = (8 if width is None else width) + each * (node.bounds.low or 0)
            return 1 + min(8, root) if node.is_extensible else root
