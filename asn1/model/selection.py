"""Selection of messages by names and patterns, with the modules that they need."""

import difflib
import fnmatch
from collections.abc import Iterable, Iterator

from asn1.model.types import (
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
    """Unknown message name; str() suggests similar names."""


def standard(schema: Schema) -> tuple[str, ...]:
    """Return the names of all messages except experimental ones."""
    return tuple(name for name, message in schema.messages.items() if not message.is_experimental)


def named(schema: Schema, words: Iterable[str]) -> tuple[str, ...]:
    """Return the messages that the words select, in the order of the schema.

    words  an edition ("cam-1.4.1"), a type for its preferred edition ("cam"), or a pattern ("cam-*").

    Raises UnknownMessageError for a word that selects none.
    """
    found = {name for word in words for name in _matching(schema, word)}
    return tuple(name for name in schema.messages if name in found)


def part(schema: Schema, messages: Iterable[str]) -> Schema:
    """Return a schema of these messages and of all modules that they need, each complete."""
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
    raise UnknownMessageError(f"unknown message {word!r}; {hint}")


def _rank(message: Message) -> int:
    return message.rank


# ---------------------------------------------------------------- references


def reached(schema: Schema, start: set[str]) -> set[str]:
    """Return the keys of the modules and of all that they refer to, directly or indirectly."""
    found: set[str] = set()
    waiting = set(start)
    while waiting:
        key = waiting.pop()
        found.add(key)
        waiting |= neighbours(schema, key) - found
    return found


def neighbours(schema: Schema, key: str) -> set[str]:
    """Return the keys of the other modules that a module refers to directly."""
    module = schema.modules[key]
    references = [
        *(one for definition in module.definitions.values() for one in references_of(definition.type)),
        *(one for class_ in module.classes.values() for one in references_of(class_.id_type)),
        *(one for set_ in module.sets.values() for row in set_.rows for one in references_of(row.type)),
        *(set_.class_ for set_ in module.sets.values()),
    ]
    return {reference.module for reference in references} - {key}


def references_of(type_: Type) -> Iterator[Reference]:
    """Yield every reference in a type, including the type itself: to definitions, classes and sets."""
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
    """Yield the components in order: root, additions (groups expanded), tail."""
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
