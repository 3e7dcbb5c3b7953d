"""Units of the schema's definitions and components.

They come from the reviewed table, from comments, or from the same element of Release 2.
"""

import dataclasses
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

from asn1.model import text, types

UNITS = text.FOLDER / "units.toml"


class Units:
    """Units of the schema.

    spelling  text of a comment -> unit in the schema; "" for no unit.
    table     key of a module -> path ("SpeedLimit", "TimeVal.sec") -> unit; "" for none.
    """

    def __init__(self, spelling: Mapping[str, str], table: Mapping[str, Mapping[str, str]]) -> None:
        self._spelling = spelling
        self._table = table

    def normal(self, comment: str | None) -> str | None:
        """Return the unit of a comment: single blanks, decimal point, and the spelling of [spelling]."""
        if comment is None:
            return None
        words = re.sub(r"(?<=\d),(?=\d)", ".", " ".join(comment.split()).strip("*").strip().rstrip("."))
        return self._spelling.get(words, words) or None

    def add(self, module: types.Module, others: list[Mapping[str, types.Definition]]) -> types.Module:
        """Return the module with units.

        A unit comes from the table, else from the module, else from the same element elsewhere.
        """
        table = self._table.get(module.key, {})
        definitions: dict[str, types.Definition] = {}
        for name, definition in module.definitions.items():
            unit = table[name] or None if name in table else definition.unit or _same(definition, others)
            type_ = _with_units(definition.type, name, table)
            definitions[name] = types.Definition(name, type_, unit)
        return dataclasses.replace(module, definitions=definitions)

    def unused(self, modules: Mapping[str, types.Module]) -> list[str]:
        """Return the entries of the table that name nothing in the modules: "r1_cdd: SpeedLimt"."""
        return [
            f"{key}: {path}"
            for key, table in self._table.items()
            for path in table
            if key in modules and not _exists(modules[key], path)
        ]


def read_units(path: Path = UNITS) -> Units:
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    return Units(document.pop("spelling", {}), document)


def _same(definition: types.Definition, others: list[Mapping[str, types.Definition]]) -> str | None:
    """Return the unit of an INTEGER with the same name and range in another module; the first one counts."""
    for other in others:
        found = other.get(definition.name)
        if found is None or found.unit is None:
            continue
        if isinstance(found.type, types.Integer) and isinstance(definition.type, types.Integer):
            return found.unit if _range(found.type) == _range(definition.type) else None
    return None


def _range(type_: types.Integer) -> tuple[types.ElementSet, ...]:
    return tuple(constraint.root for constraint in type_.constraints)


def _with_units(type_: types.Type, path: str, table: Mapping[str, str]) -> types.Type:
    """Return a type whose inner components have the table's units. Their paths begin with the definition's name."""
    if not any(line.startswith(path + ".") for line in table):
        return type_
    match type_:
        case types.Sequence():
            return dataclasses.replace(
                type_,
                root=_members(type_.root, path, table),
                additions=tuple(_addition(one, path, table) for one in type_.additions),
                tail=_members(type_.tail, path, table),
            )
        case types.Choice():
            additions = tuple(_addition(one, path, table) for one in type_.additions)
            return dataclasses.replace(type_, root=_members(type_.root, path, table), additions=additions)
        case types.SequenceOf():
            return dataclasses.replace(type_, element=_with_units(type_.element, path, table))
    return type_


def _members(
    components: tuple[types.Component, ...], path: str, table: Mapping[str, str]
) -> tuple[types.Component, ...]:
    return tuple(_component(one, path, table) for one in components)


def _addition(one: types.Component | types.Group, path: str, table: Mapping[str, str]) -> types.Component | types.Group:
    if isinstance(one, types.Group):
        return dataclasses.replace(one, components=_members(one.components, path, table))
    return _component(one, path, table)


def _component(one: types.Component, path: str, table: Mapping[str, str]) -> types.Component:
    inside = f"{path}.{one.name}"
    return dataclasses.replace(one, type=_with_units(one.type, inside, table), unit=table.get(inside, one.unit))


def _exists(module: types.Module, path: str) -> bool:
    name, *rest = path.split(".")
    if name not in module.definitions:
        return False
    type_ = module.definitions[name].type
    for word in rest:
        while isinstance(type_, types.SequenceOf):
            type_ = type_.element
        if not isinstance(type_, types.Sequence | types.Choice):
            return False
        found = [one for one in components_of(type_) if one.name == word]
        if not found:
            return False
        type_ = found[0].type
    return True


def components_of(type_: types.Sequence | types.Choice) -> list[types.Component]:
    """Return all components; groups are expanded."""
    tail = type_.tail if isinstance(type_, types.Sequence) else ()
    found: list[types.Component] = []
    for one in (*type_.root, *type_.additions, *tail):
        found += one.components if isinstance(one, types.Group) else (one,)
    return found
