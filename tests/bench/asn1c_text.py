"""A schema as asn1c can read it: what its parser refuses is written otherwise, with the same encoding.

asn1c 0.9.28 knows no information objects, no [[ ]] and no two types of one name. With that it is helped, so that there is
something to compare with. SIZE (1..32, ..., 100), which it parses and codes as 1..100, is changed only when asked for.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from typing import cast

from asn1.model import types as t

OPEN = "open types as OCTET STRING, which it does not look into"
GROUP = "[[ ]] as one SEQUENCE"
SIZE = "SIZE (a..b, ...) without what follows"  # X.691 20.4: the root alone decides, what follows has a general length
NAMES = "types renamed that two modules define"

Additions = tuple[t.Component | t.Group, ...]


def helped(schema: t.Schema, sizes: bool = False) -> tuple[t.Schema, list[str]]:
    """The schema without what asn1c refuses, and what was done to it: the words above.

    sizes  SIZE is changed as well.
    """
    help_ = _Help(schema, sizes)
    modules = {key: help_.module(module) for key, module in schema.modules.items()}
    messages = {name: replace(one, pdu=cast(t.Reference, help_.type(one.pdu))) for name, one in schema.messages.items()}
    return t.Schema(modules, messages), sorted(help_.given)


class _Help:
    def __init__(self, schema: t.Schema, sizes: bool) -> None:
        self._schema = schema
        self._sizes = sizes
        self._count = Counter(name for module in schema.modules.values() for name in module.definitions)
        self.given: set[str] = set()

    def module(self, module: t.Module) -> t.Module:
        definitions = [
            replace(one, name=self._name(module.key, one.name), type=self.type(one.type))
            for one in module.definitions.values()
        ]
        return replace(module, definitions={one.name: one for one in definitions}, classes={}, sets={})

    def type(self, type_: t.Type) -> t.Type:
        match type_:
            case t.Sequence():
                return replace(
                    type_,
                    root=self._components(type_.root),
                    additions=self._groups(type_.additions),
                    tail=self._components(type_.tail),
                )
            case t.Choice():
                flat = [part for one in type_.additions for part in _members(one)]
                if len(flat) != len(type_.additions):
                    self.given.add(GROUP)
                return replace(type_, root=self._components(type_.root), additions=self._components(flat))
            case t.SequenceOf():
                constraints = tuple(map(self._size, type_.constraints)) if self._sizes else type_.constraints
                return replace(type_, element=self.type(type_.element), constraints=constraints)
            case t.Reference():
                return replace(type_, name=self._name(type_.module, type_.name))
            case t.ClassField():
                return self.type(self._schema.modules[type_.class_.module].classes[type_.class_.name].id_type)
            case t.OpenType():
                self.given.add(OPEN)
                return t.OctetString()  # X.691 11.2: a length and the octets, as clause 17 has it without bounds
        return type_

    def _size(self, constraint: t.Constraint) -> t.Constraint:
        if not isinstance(constraint.root, t.Size) or constraint.root.within.additions is None:
            return constraint
        self.given.add(SIZE)
        return replace(constraint, root=t.Size(replace(constraint.root.within, additions=None)))

    def _name(self, module: str, name: str) -> str:
        if self._count[name] == 1:
            return name
        self.given.add(NAMES)
        return f"{name}-{module.replace('_', '-')}"

    def _components(self, components: Iterable[t.Component]) -> tuple[t.Component, ...]:
        return tuple(replace(one, type=self.type(one.type)) for one in components)

    def _groups(self, additions: Additions) -> tuple[t.Component, ...]:
        """X.691 19.9: a group is encoded as a SEQUENCE of its components would be, and is absent where all of them are."""
        made: list[t.Component] = []
        for number, one in enumerate(additions, 1):
            if isinstance(one, t.Group):
                self.given.add(GROUP)
                made.append(t.Component(f"group{number}", t.Sequence(self._components(one.components)), True))
            else:
                made += self._components([one])
        return tuple(made)


def _members(one: t.Component | t.Group) -> tuple[t.Component, ...]:
    return one.components if isinstance(one, t.Group) else (one,)
