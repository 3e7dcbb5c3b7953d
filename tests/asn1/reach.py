"""Schema of one PDU: only the definitions that it uses."""

from collections.abc import Iterator
from dataclasses import replace

from asn1.model import types as t

Key = tuple[str, str]  # module, name


def key_of(reference: t.Reference) -> Key:
    return reference.module, reference.name


def components(type_: t.Sequence | t.Choice) -> Iterator[t.Component]:
    """All of them, with the members of groups."""
    tail = type_.tail if isinstance(type_, t.Sequence) else ()
    for one in (*type_.root, *type_.additions, *tail):
        yield from one.components if isinstance(one, t.Group) else (one,)


def reached(schema: t.Schema, type_: t.Type) -> dict[Key, None]:
    """Definitions, classes and object sets, in the order in which they are met."""
    found: dict[Key, None] = {}
    waiting: list[t.Type] = [type_]
    while waiting:
        for reference, target in _next(schema, waiting.pop()):
            if reference is None:
                waiting.append(target)
            elif key_of(reference) not in found:
                found[key_of(reference)] = None
                waiting.append(target)
    return found


def pruned(schema: t.Schema, pdu: t.Reference) -> t.Schema:
    """Only what the PDU reaches; modules that hold nothing of it are gone."""
    keep = reached(schema, pdu)
    modules = {}
    for key, module in schema.modules.items():
        definitions = {name: one for name, one in module.definitions.items() if (key, name) in keep}
        classes = {name: one for name, one in module.classes.items() if (key, name) in keep}
        sets = {name: one for name, one in module.sets.items() if (key, name) in keep}
        if definitions or classes or sets:
            modules[key] = replace(module, definitions=definitions, classes=classes, sets=sets)
    messages = {name: one for name, one in schema.messages.items() if one.pdu == pdu}
    return replace(schema, modules=modules, messages=messages)


def _next(schema: t.Schema, type_: t.Type) -> Iterator[tuple[t.Reference | None, t.Type]]:
    """What stands right behind a type: with a reference where it has a name, and the type of what is named."""
    for constraint in type_.constraints:
        for contained in _contained(constraint.root):
            yield None, contained
    match type_:
        case t.Reference():
            yield type_, schema.resolve(type_).type
        case t.Sequence() | t.Choice():
            yield from ((None, one.type) for one in components(type_))
        case t.SequenceOf():
            yield None, type_.element
        case t.ClassField() | t.OpenType():
            id_type = schema.modules[type_.class_.module].classes[type_.class_.name].id_type
            yield type_.class_, id_type
            rows = schema.modules[type_.set_.module].sets[type_.set_.name].rows
            yield type_.set_, t.Choice(tuple(t.Component("row", row.type) for row in rows))


def _contained(elements: t.ElementSet) -> Iterator[t.Type]:
    match elements:
        case t.Contents(type_):
            yield type_
        case t.AnyOf(members) | t.AllOf(members):
            for member in members:
                yield from _contained(member)
