"""Which messages somebody means, and the part of the schema that they need."""

import difflib
import fnmatch
from collections.abc import Iterable, Iterator

from asn1.types import (
    AllExcept,
    AllOf,
    AnyOf,
    Choice,
    ClassField,
    Component,
    Constraint,
    Contents,
    Element,
    ElementSet,
    Group,
    Inner,
    Message,
    OpenType,
    Reference,
    Schema,
    Sequence,
    SequenceOf,
    Type,
)


class UnknownMessageError(LookupError):
    """No message is called so; str() says which are alike."""


def standard(schema: Schema) -> tuple[str, ...]:
    """Every message but the experimental ones."""
    return tuple(name for name, message in schema.messages.items() if not message.is_experimental)


def named(schema: Schema, words: Iterable[str]) -> tuple[str, ...]:
    """What the words name, in the order of the schema: "cam-1.4.1", "cam" (its preferred edition), "cam-*".

    Raises UnknownMessageError.
    """
    found = {name for word in words for name in _matching(schema, word)}
    return tuple(name for name in schema.messages if name in found)


def part(schema: Schema, messages: Iterable[str]) -> Schema:
    """The modules, whole, that these messages reach, and the messages."""
    chosen = {name: schema.messages[name] for name in messages}
    needed = reached(schema, {message.pdu.module for message in chosen.values()})
    return Schema({key: module for key, module in schema.modules.items() if key in needed}, chosen)


def _matching(schema: Schema, word: str) -> list[str]:
    word = word.lower()
    if word in schema.messages:
        return [word]
    of_type = [message for message in schema.messages.values() if message.type == word]
    if of_type:
        return [min(of_type, key=_rank).name]
    matching = fnmatch.filter(schema.messages, word)
    if matching:
        return matching
    known = dict.fromkeys([*(message.type for message in schema.messages.values()), *schema.messages])
    alike = difflib.get_close_matches(word, known, n=3)
    hint = f"did you mean {' or '.join(alike)}?" if alike else "`captain-asn1 list` shows all"
    raise UnknownMessageError(f"no message is called {word!r}; {hint}")


def _rank(message: Message) -> int:
    return message.rank


# ---------------------------------------------------------------- what refers to what


def reached(schema: Schema, start: set[str]) -> set[str]:
    """Keys of some modules, and of all that these refer to."""
    found: set[str] = set()
    waiting = set(start)
    while waiting:
        key = waiting.pop()
        found.add(key)
        waiting |= neighbours(schema, key) - found
    return found


def neighbours(schema: Schema, key: str) -> set[str]:
    """Keys of the other modules that a module refers to."""
    module = schema.modules[key]
    references = [
        *(one for definition in module.definitions.values() for one in references_of(definition.type)),
        *(one for class_ in module.classes.values() for one in references_of(class_.id_type)),
        *(one for set_ in module.sets.values() for row in set_.rows for one in references_of(row.type)),
        *(set_.class_ for set_ in module.sets.values()),
    ]
    return {reference.module for reference in references} - {key}


def references_of(type_: Type) -> Iterator[Reference]:
    """Every definition, class and set that a type names, itself included."""
    for constraint in type_.constraints:
        yield from _of_constraint(constraint)
    match type_:
        case Reference():
            yield type_
        case Sequence() | Choice():
            for component in components_of(type_):
                yield from references_of(component.type)
        case SequenceOf():
            yield from references_of(type_.element)
        case ClassField():
            yield from (type_.class_, type_.set_)
        case OpenType():
            yield from (type_.class_, type_.set_)
        case _:
            pass


def components_of(type_: Sequence | Choice) -> Iterator[Component]:
    """Root, additions with the members of groups, tail."""
    yield from type_.root
    for addition in type_.additions:
        yield from addition.components if isinstance(addition, Group) else (addition,)
    if isinstance(type_, Sequence):
        yield from type_.tail


def _of_constraint(constraint: Constraint | None) -> Iterator[Reference]:
    if constraint is not None:
        yield from _of_elements(constraint.root)
        if constraint.additions is not None:
            yield from _of_elements(constraint.additions)


def _of_elements(elements: ElementSet) -> Iterator[Reference]:
    match elements:
        case Contents(type_):
            yield from references_of(type_)
        case Inner(components=components):
            for component in components:
                yield from _of_constraint(component.constraint)
        case Element(constraint):
            yield from _of_constraint(constraint)
        case AnyOf(members) | AllOf(members):
            for member in members:
                yield from _of_elements(member)
        case AllExcept(member):
            yield from _of_elements(member)
        case _:
            pass
