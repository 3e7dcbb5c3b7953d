"""Layout: resolves the schema's types, with their bounds, bits and place in memory.

`lay_out` follows every reference from the chosen messages. It makes one `Node` per definition, per type inside a type,
and per reference with a further constraint that changes the encoding. A constrained reference to a SEQUENCE or CHOICE
shares the node of its definition, because the encoding is the same. Constraints for validators are in `Field.checks`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from asn1.layout.memory import measure
from asn1.layout.nodes import (
    STRUCTS,
    Field,
    Kind,
    Layout,
    LayoutError,
    Node,
    by_value_order,
    strong_components,
    type_name,
)
from asn1.model import constraints as sets
from asn1.model.constraints import Bounds
from asn1.model.forms import Forms
from asn1.model.types import (  # fmt: skip
    BitString,
    Boolean,
    CharacterString,
    Choice,
    ClassField,
    Component,
    Constraint,
    Enumerated,
    Group,
    Integer,
    Message,
    Null,
    ObjectIdentifier,
    OctetString,
    OpenType,
    Reference,
    Schema,
    SequenceOf,
    Type,
)
from asn1.model.types import Sequence as SequenceType

__all__ = ["STRUCTS", "Field", "Kind", "Layout", "Node", "lay_out"]

# BIT STRINGs of fixed size up to this many bits become numbers in C, OCTET STRINGs up to this many octets arrays.
SMALL_MAX = 64

TEXTS = {
    "IA5String": Kind.IA5,
    "VisibleString": Kind.VISIBLE,
    "ISO646String": Kind.VISIBLE,
    "PrintableString": Kind.PRINTABLE,
    "NumericString": Kind.NUMERIC,
    "UTF8String": Kind.UTF8,
}


def lay_out(schema: Schema, messages: Sequence[Message]) -> Layout:
    """Return the layout of all types that the messages use.

    Raises LayoutError if constraints leave no value, or a number is wider than 64 bits; KeyError for a reference to a
    missing definition.
    """
    builder = _Builder(schema)
    pdus = {}
    for message in messages:
        pdus[message.name] = builder.definition(message.pdu)
        pdus[message.name].is_entry = True
    builder.finish()
    forms = Forms(builder.made, builder.taken)
    pdus |= {message.name: forms.of(pdus[message.name]) for message in messages if message.form_of}
    builder.made += forms.made
    nodes: dict[str, list[Node]] = {}
    for node in by_value_order(builder.made):
        nodes.setdefault(node.module, []).append(node)
    return Layout(schema, tuple(messages), pdus, nodes)


@dataclass(frozen=True, slots=True)
class _Place:
    """Position of a type, from which its node gets its names: module, C name, ASN.1 name."""

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
            type_name(f"{key}_{name.replace('-', '_')}")
            for key, module in schema.modules.items()
            for name in module.definitions
        }

    def definition(self, reference: Reference) -> Node:
        known = self.defined.get((reference.module, reference.name))
        if known is not None:
            return known
        module = self.schema.modules[reference.module]
        c_name = type_name(f"{module.key}_{reference.name.replace('-', '_')}")
        _, _, named = self.base(reference)
        place = _Place(module.key, c_name, reference.name, named.unit, module.standard)
        type_, constraints, _ = self.base(self.schema.resolve(reference).type)
        node = Node(Kind.NULL, module.key, c_name, is_defined=True)
        self.defined[reference.module, reference.name] = node
        self.fill(node, type_, constraints, place)
        return node

    def base(self, type_: Type) -> tuple[Type, tuple[Constraint, ...], _Place]:
        """Follow all references.

        Returns the type, all constraints in serial order, and the names from the references.
        """
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
        """Return the node of a type at a place, and the constraints that a validator must check there in addition."""
        if isinstance(type_, Reference):
            if not type_.constraints:
                return self.definition(type_), ()
            bottom, _, _ = self.base(type_)
            if isinstance(bottom, SequenceType | Choice):
                return self.definition(type_), type_.constraints
        bottom, constraints, named = self.base(type_)
        is_struct = isinstance(bottom, SequenceType | Choice | SequenceOf)
        c_name = type_name(place.c_name) if is_struct else place.c_name
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
        except LayoutError:
            raise
        except ValueError as error:
            raise LayoutError(node.c_name, str(error)) from None

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
                raise TypeError(f"{node.c_name}: type {type(type_).__name__} has no memory layout")
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
            # Version brackets do not form a group in a CHOICE: each alternative has its own index (X.680 29.1).
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
        """Mark recursive types, entry points, and fields that need a pointer because of recursion or size."""
        component_of = strong_components(self.made)
        for node in self.made:
            node.recurs = any(component_of[child] == component_of[node] for child in node.children())
        for node in self.made:
            if node.kind is Kind.LIST and node.item.kind in STRUCTS:
                node.item.is_entry = True
            for f in node.fields:
                if f.node.kind in STRUCTS and component_of[f.node] == component_of[node]:
                    f.is_pointer = True
        known: dict[Node, tuple[int, int]] = {}
        for node in self.made:
            measure(node, known)


def _is_small(bounds: Bounds) -> bool:
    is_fixed = bounds.low == bounds.high and not bounds.is_extensible and not bounds.lost_marker
    return is_fixed and 1 <= (bounds.low or 0) <= SMALL_MAX
