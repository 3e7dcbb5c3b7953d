"""Writer of a schema file; text.py describes the format."""

import json
import re

from asn1.model import types
from asn1.model.constraint_text import constraint_text

_IDENTIFIER = re.compile(r"[a-z][A-Za-z0-9-]*")


def dump(module: types.Module) -> str:
    """Return a module as text. Raises ValueError for a CONTAINING with a type that needs more than one line."""
    writer = _Writer(module.key)
    header = [f"module {module.key} {module.name}"]
    header += [f"oid {module.oid}"] if module.oid else []
    header += [f"standard {module.standard}", f"source {module.source}", f"sha256 {module.sha256}"]
    header += [f"left-out {' '.join(module.left_out)}"] if module.left_out else []
    lines = [*header, ""]
    for class_ in module.classes.values():
        lines += writer.node(f"class {class_.name}: {class_.type_field} by {class_.id_field} ", class_.id_type, 0)
    for set_ in module.sets.values():
        lines += writer.object_set(set_)
    for definition in module.definitions.values():
        lines += writer.node(f"type {definition.name}: ", definition.type, 0, _unit(definition.unit))
    return "\n".join(lines) + "\n"


class _Writer:
    def __init__(self, key: str) -> None:
        self._key = key

    def node(self, front: str, type_: types.Type, depth: int, behind: str = "") -> list[str]:
        """Return the line of a type, and the indented lines below it.

        front, behind  text before and after the type on its line.
        """
        return [f"{'  ' * depth}{front}{self._head(type_)}{behind}", *self._below(type_, depth + 1)]

    def object_set(self, set_: types.ObjectSet) -> list[str]:
        lines = [f"set {set_.name} of {self._name(set_.class_)}"]
        for row in set_.rows:
            lines += self.node(f"{row.value}: ", row.type, 1)
        return lines + (["  ..."] if set_.is_extensible else [])

    def _name(self, reference: types.Reference) -> str:
        return reference.name if reference.module == self._key else f"{reference.module}.{reference.name}"

    def _head(self, type_: types.Type) -> str:
        word = self._word(type_)
        constraints = [constraint_text(one, self._inline) for one in type_.constraints]
        if isinstance(type_, types.SequenceOf):
            return " ".join([word, *constraints, "of", self._head(type_.element)])
        return " ".join([word, *constraints])

    def _inline(self, type_: types.Type) -> str:
        if self._below(type_, 0):
            raise ValueError("the type inside CONTAINING is too complex for one line of a schema: give it a name")
        return self._head(type_)

    def _word(self, type_: types.Type) -> str:
        match type_:
            case types.CharacterString():
                return f"string {type_.kind}"
            case types.ObjectIdentifier():
                return "relative-oid" if type_.is_relative else "oid"
            case types.SequenceOf():
                return "set-list" if type_.is_set else "list"
            case types.Reference():
                return self._name(type_)
            case types.ClassField():
                return f"field {self._name(type_.class_)} of {self._name(type_.set_)}"
            case types.OpenType():
                return f"open {self._name(type_.class_)} of {self._name(type_.set_)} by {type_.selector}"
        return _WORD_OF[type(type_)]

    def _below(self, type_: types.Type, depth: int) -> list[str]:
        indent = "  " * depth
        match type_:
            case types.Integer() | types.BitString():
                return [f"{indent}{one.name} = {one.value}" for one in type_.names]
            case types.Enumerated():
                lines = [f"{indent}{one.name} = {one.value}" for one in type_.root]
                lines += [f"{indent}..."] if type_.is_extensible else []
                return lines + [f"{indent}{one.name} = {one.value}" for one in type_.additions]
            case types.SequenceOf():
                return self._below(type_.element, depth)
            case types.Sequence() | types.Choice():
                return self._members(type_, depth)
        return []

    def _members(self, type_: types.Sequence | types.Choice, depth: int) -> list[str]:
        lines = [line for one in type_.root for line in self._component(one, depth)]
        if type_.is_extensible:
            lines.append("  " * depth + "...")
        for addition in type_.additions:
            if isinstance(addition, types.Component):
                lines += self._component(addition, depth)
                continue
            lines.append("  " * depth + "[[" + ("" if addition.version is None else f" {addition.version}"))
            lines += [line for one in addition.components for line in self._component(one, depth + 1)]
        tail = type_.tail if isinstance(type_, types.Sequence) else ()
        if tail:
            lines.append("  " * depth + "...")
        return lines + [line for one in tail for line in self._component(one, depth)]

    def _component(self, one: types.Component, depth: int) -> list[str]:
        behind = " optional" if one.is_optional else ""
        if one.default is not None:
            behind += f" default {_default(one.default)}"
        return self.node(f"{one.name}: ", one.type, depth, behind + _unit(one.unit))


_WORD_OF: dict[type, str] = {
    types.Boolean: "boolean",
    types.Null: "null",
    types.Integer: "integer",
    types.Enumerated: "enumerated",
    types.BitString: "bits",
    types.OctetString: "octets",
    types.Sequence: "sequence",
    types.Choice: "choice",
}


def _unit(unit: str | None) -> str:
    return "" if unit is None else f" unit {json.dumps(unit, ensure_ascii=False)}"


def _default(value: types.Default) -> str:
    match value:
        case bool():
            return "TRUE" if value else "FALSE"
        case bytes():
            return f"'{value.hex().upper()}'H"
        case (octets, bits):
            digits = "".join(f"{octet:08b}" for octet in octets)[:bits]
            return f"'{digits}'B"
        case str() if not _IDENTIFIER.fullmatch(value):
            return json.dumps(value, ensure_ascii=False)
    return str(value)
