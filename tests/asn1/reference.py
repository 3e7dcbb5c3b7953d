"""UPER written slowly from the text of X.691 (02/2021), to decide where other codecs disagree.

It shares nothing with asn1/layout/layout.py and the C that is made from it: one function per clause, straight from the schema, big
integers for bits. It only encodes; that a value comes back from its octets is for the codec under test to show.
"""

from collections.abc import Callable, Sequence
from typing import Any

from asn1.model import types as t
from tests.asn1 import bits as b
from tests.asn1.bits import Bits, Encode
from tests.asn1.ranges import numbers, sizes, unfold


class Encoder:
    """Encodes values of one schema, in the shapes of asn1/guide/python-functions.md."""

    def __init__(self, schema: t.Schema) -> None:
        self._schema = schema
        self._known: dict[tuple[str, str], Encode] = {}

    def encode(self, pdu: t.Type, value: Any) -> bytes:
        bits = Bits()
        self.encoder(pdu)(bits, value)
        return bits.octets()

    def encoder(self, type_: t.Type) -> Encode:
        if isinstance(type_, t.Reference) and not type_.constraints:
            return self._named(type_)
        base, constraints = unfold(self._schema, type_)
        return self._build(base, constraints)

    def _named(self, reference: t.Reference) -> Encode:
        key = (reference.module, reference.name)

        def later(bits: Bits, value: Any) -> None:  # for a type that recurs: while it is built
            self._known[key](bits, value)

        if key not in self._known:
            self._known[key] = later
            self._known[key] = self._build(*unfold(self._schema, reference))
        return self._known[key]

    def _build(self, type_: t.Type, constraints: Sequence[t.Constraint]) -> Encode:
        match type_:
            case t.Boolean():
                return b.boolean
            case t.Null():
                return b.null
            case t.Integer():
                return b.integer(numbers(constraints))
            case t.Enumerated():
                return b.enumerated(type_)
            case t.BitString():
                return b.bit_string(sizes(constraints), bool(type_.names))
            case t.OctetString():
                return b.octet_string(sizes(constraints))
            case t.CharacterString():
                return b.character_string(type_.kind, constraints)
            case t.ObjectIdentifier():
                return b.object_identifier(type_.is_relative)
            case t.SequenceOf():
                return b.list_of(sizes(constraints), self.encoder(type_.element))
            case t.Choice():
                return self._choice(type_)
            case t.Sequence():
                return self._sequence(type_)
        raise TypeError(type_)

    def _choice(self, type_: t.Choice) -> Encode:
        """23."""
        width = (len(type_.root) - 1).bit_length()
        root = {one.name: (index, self.encoder(one.type)) for index, one in enumerate(type_.root)}
        additions = {one.name: (index, self.encoder(one.type)) for index, one in enumerate(flat(type_.additions))}

        def encode(bits: Bits, value: tuple[str, Any]) -> None:
            name, content = value
            if type_.is_extensible:
                bits.put(name not in root, 1)  # 23.5
            if name in root:
                bits.put(root[name][0], width)  # 23.6
                root[name][1](bits, content)
            elif name in additions:
                b.small(bits, additions[name][0])  # 23.8
                b.open_type(bits, additions[name][1], content)
            else:
                b.small(bits, int(name[1:-1]))
                b.general(bits, content)

        return encode

    def _sequence(self, type_: t.Sequence) -> Encode:
        """19."""
        root = self._components((*type_.root, *type_.tail))
        additions = [self._addition(one) for one in type_.additions]

        def encode(bits: Bits, value: dict[str, Any]) -> None:
            if not type_.is_extensible:
                root(bits, value)
                return
            sent: dict[int, Encode] = {i: put for i, (is_there, put) in enumerate(additions) if is_there(value)}
            sent |= {int(key[1:-1]): _kept(key) for key in value if key[0] == "[" and key != "[]"}
            bits.put(bool(sent), 1)  # 19.1
            root(bits, value)
            if sent:
                _additions(bits, value, sent, value.get("[]", max(len(additions), max(sent) + 1)))

        return encode

    def _components(self, components: Sequence[t.Component]) -> Encode:
        """The preamble and what is present: 19.2 to 19.6; a default is never sent, as in canonical PER (19.5)."""
        parts = [(one, self._member(one)) for one in components]

        def encode(bits: Bits, value: dict[str, Any]) -> None:
            for component, _ in parts:
                if component.is_optional or component.default is not None:
                    bits.put(is_sent(component, value), 1)
            for component, put in parts:
                if is_sent(component, value):
                    put(bits, value)

        return encode

    def _addition(self, addition: t.Component | t.Group) -> tuple[Callable[[dict[str, Any]], bool], Encode]:
        """How to see that it is sent, and how. A group is a SEQUENCE of its members (19.9, note 1)."""
        if isinstance(addition, t.Component):
            return lambda value: is_sent(addition, value), self._member(addition)
        members = addition.components
        return lambda value: any(is_sent(one, value) for one in members), self._components(members)

    def _member(self, component: t.Component) -> Encode:
        """Of the dict of its SEQUENCE."""
        if isinstance(component.type, t.OpenType):
            return self._open_type(component.name, component.type)
        put = self.encoder(component.type)
        return lambda bits, value: put(bits, value[component.name])

    def _open_type(self, name: str, type_: t.OpenType) -> Encode:
        """11.2: the type that the identifier beside it announces, in octets of its own."""
        set_ = self._schema.modules[type_.set_.module].sets[type_.set_.name]
        rows = {row.value: self.encoder(row.type) for row in set_.rows}

        def encode(bits: Bits, value: dict[str, Any]) -> None:
            row = rows.get(value[type_.selector])
            if row is None:
                b.general(bits, value[name])
            else:
                b.open_type(bits, row, value[name])

        return encode


def flat(additions: Sequence[t.Component | t.Group]) -> list[t.Component]:
    """With the members of groups in their places: in a CHOICE the brackets mean nothing to PER (23.8)."""
    return [
        one for addition in additions for one in (addition.components if isinstance(addition, t.Group) else (addition,))
    ]


def is_sent(component: t.Component, value: dict[str, Any]) -> bool:
    default = component.default
    return component.name in value and (default is None or value[component.name] != default)


def _kept(key: str) -> Encode:
    return lambda bits, value: bits.put_all(value[key])


def _additions(bits: Bits, value: dict[str, Any], sent: dict[int, Encode], count: int) -> None:
    b.small_length(bits, count)  # 19.8
    for index in range(count):
        bits.put(index in sent, 1)
    for index in range(count):  # 19.9
        if index in sent:
            b.open_type(bits, sent[index], value)
