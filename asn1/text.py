"""The schema as text: one file per module edition, one line per node, made to be read in a diff; exact both ways.

    module r1_cam CAM-PDU-Descriptions
    oid { itu-t(0) identified-organization(4) etsi(0) itsDomain(5) wg1(1) en(302637) cam(2) version(2) }
    standard ETSI EN 302 637-2 v1.4.1
    source EN302637-2v141-CAM.asn
    sha256 15c7...

    type CamParameters: sequence
      basicContainer: BasicContainer
      lowFrequencyContainer: LowFrequencyContainer optional
      ...
    type GenerationDeltaTime: integer (0..65535) unit "ms"
      oneMilliSec = 1
    class REG-EXT-ID-AND-TYPE: &Type by &id RegionId
    set Reg-MapData of r1_dsrc.REG-EXT-ID-AND-TYPE
      3: r1_addgrpc.MapData-addGrpC
      ...

What a type holds stands below it, indented; a reference to another module has that module's key in front.
"""

import json
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from asn1 import types
from asn1.constraint_text import Words, constraint_text, read_constraint

FOLDER = Path(__file__).parent
SCHEMA = FOLDER / "schema"
EDITIONS = FOLDER / "editions.toml"
_NAMED = re.compile(r"([a-z][A-Za-z0-9-]*) = (-?[0-9]+)")
_IDENTIFIER = re.compile(r"[a-z][A-Za-z0-9-]*")


class TextError(ValueError):
    """A schema text that cannot be read: "r1_cam.schema:17: expected ')', found ','"."""


# ---------------------------------------------------------------- to text


def dump(module: types.Module) -> str:
    """A module as text. Raises ValueError where CONTAINING holds a type that needs more than a line."""
    writer = _Writer(module.key)
    header = [f"module {module.key} {module.name}"]
    header += [f"oid {module.oid}"] if module.oid else []
    header += [f"standard {module.standard}", f"source {module.source}", f"sha256 {module.sha256}", ""]
    lines = [*header]
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
        """The line of a type, and what stands below it."""
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
            raise ValueError("a type inside CONTAINING that does not fit into a line: give it a name")
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


# ---------------------------------------------------------------- from text


class _Line(NamedTuple):
    """A line and those below it; number: in the file, from 1."""

    number: int
    text: str
    below: "list[_Line]"


def load(text: str, file: str = "schema") -> types.Module:
    """The module of a text. Raises TextError with file and line."""
    header, roots = _tree(text, file)
    key, _, name = header.get("module", "").partition(" ")
    missing = {"module", "standard", "source", "sha256"} - set(header)
    if missing:
        raise TextError(f"{file}:1: no line {sorted(missing)[0]!r} above the first blank one")
    reader = _Reader(key)
    classes: dict[str, types.ObjectClass] = {}
    sets: dict[str, types.ObjectSet] = {}
    definitions: dict[str, types.Definition] = {}
    for line in roots:
        try:
            match reader.root(line):
                case types.Definition() as definition:
                    definitions[definition.name] = definition
                case types.ObjectClass() as class_:
                    classes[class_.name] = class_
                case types.ObjectSet() as set_:
                    sets[set_.name] = set_
        except ValueError as error:
            raise TextError(f"{file}:{reader.number}: {error}") from None
    rest = (header.get("oid", ""), header["standard"], header["source"], header["sha256"])
    return types.Module(key, name, *rest, definitions, classes, sets)


def _tree(text: str, file: str) -> tuple[dict[str, str], list[_Line]]:
    lines = text.split("\n")
    header: dict[str, str] = {}
    roots: list[_Line] = []
    open_lines: list[_Line] = []
    in_header = True
    for number, line in enumerate(lines, 1):
        if not line.strip():
            in_header = False
        elif in_header:
            word, _, rest = line.partition(" ")
            header[word] = rest
        else:
            depth, odd = divmod(len(line) - len(line.lstrip(" ")), 2)
            if odd or depth > len(open_lines):
                raise TextError(f"{file}:{number}: this line is indented wrongly")
            node = _Line(number, line.strip(), [])
            (open_lines[depth - 1].below if depth else roots).append(node)
            open_lines[depth:] = [node]
    return header, roots


class _Reader:
    """number: of the line that is being read, for errors."""

    def __init__(self, key: str) -> None:
        self._key = key
        self.number = 1

    def root(self, line: _Line) -> types.Definition | types.ObjectClass | types.ObjectSet:
        words = self._words(line)
        kind, name = words.next(), words.next()
        match kind:
            case "type":
                words.needs(":")
                type_ = self._type(words, line.below)
                return types.Definition(name, type_, self._unit(words))
            case "class":
                words.needs(":")
                type_field = words.next()
                words.needs("by")
                id_field = words.next()
                type_ = self._type(words, line.below)
                words.end()
                return types.ObjectClass(name, id_field, type_, type_field)
            case "set":
                words.needs("of")
                class_ = self._reference(words.next())
                words.end()
                return types.ObjectSet(name, class_, *self._rows(line.below))
        raise ValueError(f"{kind!r} is neither type, class nor set")

    def _rows(self, lines: list[_Line]) -> tuple[tuple[types.Row, ...], bool]:
        rows: list[types.Row] = []
        is_extensible = False
        for line in lines:
            words = self._words(line)
            if words.takes("..."):
                is_extensible = True
            else:
                value = int(words.next())
                words.needs(":")
                rows.append(types.Row(value, self._type(words, line.below)))
            words.end()
        return tuple(rows), is_extensible

    def _words(self, line: _Line) -> Words:
        self.number = line.number
        return Words(line.text)

    def _unit(self, words: Words) -> str | None:
        unit = str(json.loads(words.next())) if words.takes("unit") else None
        words.end()
        return unit

    def _reference(self, word: str) -> types.Reference:
        module, dot, name = word.rpartition(".")
        if not name[:1].isupper():
            raise ValueError(f"{word!r} is no type")
        return types.Reference(module=module if dot else self._key, name=name)

    def _type(self, words: Words, below: list[_Line]) -> types.Type:
        """The rest of a line that begins with a type, as far as it belongs to it."""
        word = words.next()
        match word:
            case "field" | "open":
                return self._of_class(word, words)
            case "string":
                kind = words.next()
                return types.CharacterString(kind, constraints=self._constraints(words))
            case "list" | "set-list":
                constraints = self._constraints(words)
                words.needs("of")
                return types.SequenceOf(self._type(words, below), word == "set-list", constraints=constraints)
        constraints = self._constraints(words)
        match word:
            case "boolean":
                return types.Boolean(constraints=constraints)
            case "null":
                return types.Null(constraints=constraints)
            case "octets":
                return types.OctetString(constraints=constraints)
            case "oid" | "relative-oid":
                return types.ObjectIdentifier(word == "relative-oid", constraints=constraints)
            case "integer":
                return types.Integer(constraints=constraints, names=self._names(below))
            case "bits":
                return types.BitString(constraints=constraints, names=self._names(below))
            case "enumerated":
                before, is_extensible, after = _split(below)
                return types.Enumerated(self._names(before), is_extensible, self._names(after), constraints=constraints)
            case "sequence" | "choice":
                return self._structure(word, below, constraints)
        reference = self._reference(word)
        return types.Reference(module=reference.module, name=reference.name, constraints=constraints)

    def _of_class(self, word: str, words: Words) -> types.ClassField | types.OpenType:
        class_ = self._reference(words.next())
        words.needs("of")
        set_ = self._reference(words.next())
        if word == "field":
            return types.ClassField(class_, set_, constraints=self._constraints(words))
        words.needs("by")
        selector = words.next()
        return types.OpenType(class_, set_, selector, constraints=self._constraints(words))

    def _constraints(self, words: Words) -> tuple[types.Constraint, ...]:
        found: list[types.Constraint] = []
        while words.sees("("):
            found.append(read_constraint(words, lambda words: self._type(words, [])))
        return tuple(found)

    def _names(self, lines: list[_Line]) -> tuple[types.Named, ...]:
        return tuple(self._named(line) for line in lines)

    def _named(self, line: _Line) -> types.Named:
        self.number = line.number
        match = _NAMED.fullmatch(line.text)
        if match is None or line.below:
            raise ValueError(f"{line.text!r} is no name = number")
        return types.Named(match[1], int(match[2]))

    def _structure(
        self, word: str, below: list[_Line], constraints: tuple[types.Constraint, ...]
    ) -> types.Sequence | types.Choice:
        before, is_extensible, after = _split(below)
        between, _, behind = _split(after)
        root = tuple(self._component(line) for line in before)
        additions = tuple(self._addition(line) for line in between)
        if word == "choice":
            return types.Choice(root, is_extensible, additions, constraints=constraints)
        tail = tuple(self._component(line) for line in behind)
        return types.Sequence(root, is_extensible, additions, tail, constraints=constraints)

    def _addition(self, line: _Line) -> types.Component | types.Group:
        if not line.text.startswith("[["):
            return self._component(line)
        self.number = line.number
        version = line.text.removeprefix("[[").strip()
        components = tuple(self._component(one) for one in line.below)
        return types.Group(components, int(version) if version else None)

    def _component(self, line: _Line) -> types.Component:
        words = self._words(line)
        name = words.next()
        words.needs(":")
        type_ = self._type(words, line.below)
        self.number = line.number
        is_optional = words.takes("optional")
        default = _read_default(words.next()) if words.takes("default") else None
        return types.Component(name, type_, is_optional, default, self._unit(words))


def _split(lines: list[_Line]) -> tuple[list[_Line], bool, list[_Line]]:
    """Before and behind the first ellipsis, and whether there is one."""
    at = next((at for at, line in enumerate(lines) if line.text == "..."), None)
    return (lines, False, []) if at is None else (lines[:at], True, lines[at + 1 :])


def _read_default(word: str) -> types.Default:
    if word in {"TRUE", "FALSE"}:
        return word == "TRUE"
    if word.endswith("'H"):
        return bytes.fromhex(word[1:-2])
    if word.endswith("'B"):
        digits = word[1:-2]
        size = (len(digits) + 7) // 8
        return int(digits.ljust(size * 8, "0") or "0", 2).to_bytes(size, "big"), len(digits)
    if word.startswith('"'):
        return str(json.loads(word))
    return int(word) if word.lstrip("-").isdigit() else word


# ---------------------------------------------------------------- all of it


def load_schema(folder: Path = SCHEMA, editions: Path = EDITIONS) -> types.Schema:
    """Every module of a folder, and the messages of `editions` and of the folder's own *.toml whose modules are there.

    Raises TextError for a text that cannot be read, OSError for a folder that is none.
    """
    modules = {path.stem: load(path.read_text(encoding="utf-8"), path.name) for path in sorted(folder.glob("*.schema"))}
    messages: dict[str, types.Message] = {}
    for path in [editions, *sorted(folder.glob("*.toml"))]:
        messages.update((one.name, one) for one in messages_of(tomllib.loads(path.read_text(encoding="utf-8"))))
    present = {name: one for name, one in messages.items() if one.pdu.module in modules}
    return types.Schema(modules, present)


def messages_of(document: dict[str, Any]) -> Iterator[types.Message]:
    """The [[message]] tables of a TOML document."""
    standards = {module["key"]: module["standard"] for module in document.get("module", [])}
    for table in document.get("message", []):
        module, _, name = table["pdu"].partition(".")
        yield types.Message(
            name=table["name"],
            type=table["type"],
            release=table["release"],
            standard=table.get("standard") or standards[module],
            pdu=types.Reference(module=module, name=name),
            ids=tuple(table.get("ids", [])),
            versions=tuple(table.get("versions", [])),
            btp_port=table.get("btp_port", 0),
            rank=table.get("rank", 1),
            is_experimental=table.get("experimental", False),
        )
