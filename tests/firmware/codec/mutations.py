"""Mutations of a JSON value: each leaf out of range or misspelt, each member misspelt or removed, one at a time."""

import copy
from collections.abc import Iterator
from typing import Any, NamedTuple

LARGE = 10**30


class Mutation(NamedTuple):
    """A changed value. what: kind of the change. path: path of the member or leaf, with its indices."""

    what: str
    path: tuple[str | int, ...]
    value: Any


def mutations(value: Any) -> Iterator[Mutation]:
    for path in _paths(value):
        holder = _at(value, path[:-1])
        leaf = holder[path[-1]]
        if isinstance(holder, dict):
            for what, name in (("removed", None), ("misspelt", f"{path[-1]}x")):
                rest = {name if key == path[-1] else key: one for key, one in holder.items()}
                yield Mutation(f"member {what}", path, _replaced(value, path[:-1], _without(rest)))
        if isinstance(leaf, bool | dict | list):
            yield Mutation("other type", path, _replaced(value, path, None if leaf != {} else 1))
        elif isinstance(leaf, int | float):
            yield Mutation("too large", path, _replaced(value, path, LARGE))
            yield Mutation("too small", path, _replaced(value, path, -LARGE))
            yield Mutation("other type", path, _replaced(value, path, "fast"))
        elif isinstance(leaf, str):
            yield Mutation("text misspelt", path, _replaced(value, path, f"{leaf}x"))
            yield Mutation("other type", path, _replaced(value, path, 7.5))
        else:
            yield Mutation("other type", path, _replaced(value, path, 0))


def _paths(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    if path:
        yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, one in items:
        yield from _paths(one, (*path, key))


def _at(value: Any, path: tuple[str | int, ...]) -> Any:
    for key in path:
        value = value[key]
    return value


def _replaced(value: Any, path: tuple[str | int, ...], other: Any) -> Any:
    if not path:
        return other
    changed = copy.copy(value)
    changed[path[0]] = _replaced(value[path[0]], path[1:], other)
    return changed


def _without(members: dict[str | None, Any]) -> dict[str, Any]:
    return {key: one for key, one in members.items() if key is not None}
