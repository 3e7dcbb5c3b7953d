"""Reader of a schema file; text.py describes the format."""

import json
import re
from typing import NamedTuple

from asn1.model import types
from asn1.model.constraint_text import Words, read_constraint

_NAMED = re.compile(r"([a-z][A-Za-z0-9-]*) = (-?[0-9]+)")


class TextError(ValueError):
    """Invalid schema text: "r1_cam.schema:17: expected ')', found ','"."""


class _Line(NamedTuple):
    """A line and the indented lines below it. number: line number in the file, from 1."""

    number: int
    text: str
    below: "list[_Line]"


def load(text: str, file: str = "schema") -> types.Module:
    """Parse the text of a module. Raises TextError with file and line."""
    header, roots = _tree(text, file)
    key, _, name = header.get("module", "").partition(" ")
    missing = {"module", "standard", "source", "sha256"} - set(header)
    if missing:
        raise TextError(f"{file}:1: line {sorted(missing)[0]!r} is missing from the header, above the first blank line")
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
    left_out = tuple(header.get("left-out", "").split())
    return types.Module(key, name, *rest, definitions, classes, sets, left_out)


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
                raise TextError(f"{file}:{number}: invalid indentation of this line; two blanks per level")
            node = _Line(number, line.strip(), [])
            (open_lines[depth - 1].below if depth else roots).append(node)
            open_lines[depth:] = [node]
    return header, roots


class _Reader:
    """Parser of a module's lines. number: number of the current line, for errors."""

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
        raise ValueError(f"{kind!r} is not a kind of definition; use type, class or set")

    def _rows(self, lines: list[_Line]) -> tuple[tuple[types.ObjectRow, ...], bool]:
        rows: list[types.ObjectRow] = []
        is_extensible = False
        for line in lines:
            words = self._words(line)
            if words.takes("..."):
                is_extensible = True
            else:
                value = int(words.next())
                words.needs(":")
                rows.append(types.ObjectRow(value, self._type(words, line.below)))
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
            raise ValueError(f"unknown type {word!r}")
        return types.Reference(module=module if dot else self._key, name=name)

    def _type(self, words: Words, below: list[_Line]) -> types.Type:
        """Parse a type at the current word, with the lines below it. Leaves the words after the type."""
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
            raise ValueError(f"{line.text!r} is not of the form: name = number")
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
    """Return the lines before the first ellipsis, whether there is one, and the lines after it."""
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
