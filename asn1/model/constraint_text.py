"""Text of constraints in schema files: writer and exact reader.

    (0..255, ...)   (1..3 | 5)   (size (1..8, ...))   (from (32..126))   (with {..., a present, b (0..3)})
    (each (...))   (containing integer (0..9))   ((with {...}) | (with {...}))   (all except 1)

Operands of | and ^ are in parentheses unless they are ranges of numbers; min and max are the open ends.
"""

import re
from collections.abc import Callable

from asn1.model import types

_WORD = re.compile(
    r'\s*("(?:[^"\\]|\\.)*"|\'[0-9A-F]*\'[BH]|-?[0-9]+|\.\.\.|\.\.'
    r"|[A-Za-z_&][A-Za-z0-9_-]*(?:\.[A-Za-z][A-Za-z0-9-]*)?|[(){}|^,:])"
)


class Words:
    """Words of a line, read from left to right. Raises ValueError for an invalid character."""

    def __init__(self, text: str) -> None:
        self._words: list[str] = []
        self.at = 0
        end = 0
        while text[end:].strip():
            match = _WORD.match(text, end)
            if match is None:
                raise ValueError(f"{text[end:].strip()!r} is not a word of a schema")
            self._words.append(match[1])
            end = match.end()

    def sees(self, *words: str) -> bool:
        return self._words[self.at : self.at + len(words)] == list(words)

    def takes(self, *words: str) -> bool:
        if not self.sees(*words):
            return False
        self.at += len(words)
        return True

    def needs(self, word: str) -> None:
        """Consume an expected word. Raises ValueError if the next word is a different one."""
        if not self.takes(word):
            raise ValueError(f"expected {word!r}, found {self.peek()!r}")

    def peek(self) -> str:
        return self._words[self.at] if self.at < len(self._words) else ""

    def next(self) -> str:
        """Take the next word and return it. Raises ValueError at the end of the line."""
        word = self.peek()
        if not word:
            raise ValueError("the line ends too early")
        self.at += 1
        return word

    def end(self) -> None:
        """Check that the line is completely read. Raises ValueError if words remain."""
        if self.peek():
            raise ValueError(f"{self.peek()!r} is too much")


# ---------------------------------------------------------------- to text

TypeText = Callable[[types.Type], str]


def constraint_text(constraint: types.Constraint, type_text: TypeText) -> str:
    """Return a constraint as text, with its parentheses."""
    text = _set_text(constraint.root, type_text)
    if constraint.is_extensible:
        text += ", ..."
    if constraint.additions is not None:
        text += ", " + _set_text(constraint.additions, type_text)
    return f"({text})"


def _set_text(elements: types.ElementSet, type_text: TypeText) -> str:
    match elements:
        case types.Values():
            return " | ".join(_range_text(one) for one in elements.ranges)
        case types.Size():
            return "size " + constraint_text(elements.within, type_text)
        case types.Alphabet():
            return "from " + constraint_text(elements.within, type_text)
        case types.Inner():
            lines = ["..."] if elements.partial else []
            lines += [_inner_text(one, type_text) for one in elements.components]
            return f"with {{{', '.join(lines)}}}"
        case types.Element():
            return "each " + constraint_text(elements.constraint, type_text)
        case types.Contents():
            return "containing " + type_text(elements.type)
        case types.AnyOf():
            return " | ".join(_member_text(one, type_text) for one in elements.members)
        case types.AllOf():
            return " ^ ".join(_member_text(one, type_text) for one in elements.members)
        case types.AllExcept():
            return "all except " + _member_text(elements.member, type_text)


def _member_text(elements: types.ElementSet, type_text: TypeText) -> str:
    return f"({_set_text(elements, type_text)})"


def _inner_text(line: types.InnerComponent, type_text: TypeText) -> str:
    text = line.name
    if line.constraint is not None:
        text += " " + constraint_text(line.constraint, type_text)
    return text + (f" {line.presence.lower()}" if line.presence else "")


def _range_text(one: types.Range) -> str:
    if one.low is not None and one.low == one.high:
        return str(one.low)
    return f"{'min' if one.low is None else one.low}..{'max' if one.high is None else one.high}"


# ---------------------------------------------------------------- from text

TypeReader = Callable[[Words], types.Type]


def read_constraint(words: Words, read_type: TypeReader) -> types.Constraint:
    words.needs("(")
    root = _read_set(words, read_type)
    is_extensible = words.takes(",", "...")
    additions = _read_set(words, read_type) if words.takes(",") else None
    words.needs(")")
    return types.Constraint(root, is_extensible, additions)


def _read_set(words: Words, read_type: TypeReader) -> types.ElementSet:
    if _begins_range(words):
        ranges = [_read_range(words)]
        while words.takes("|"):
            ranges.append(_read_range(words))
        return types.Values(tuple(ranges))
    if words.takes("all"):
        words.needs("except")
        return types.AllExcept(_read_member(words, read_type))
    members = [_read_member(words, read_type)]
    mark = words.peek()
    while mark in {"|", "^"} and words.takes(mark):
        members.append(_read_member(words, read_type))
    if len(members) == 1:
        return members[0]
    return types.AnyOf(tuple(members)) if mark == "|" else types.AllOf(tuple(members))


def _read_member(words: Words, read_type: TypeReader) -> types.ElementSet:
    if words.takes("("):
        found = _read_set(words, read_type)
        words.needs(")")
        return found
    match words.next():
        case "size":
            return types.Size(read_constraint(words, read_type))
        case "from":
            return types.Alphabet(read_constraint(words, read_type))
        case "each":
            return types.Element(read_constraint(words, read_type))
        case "containing":
            return types.Contents(read_type(words))
        case "with":
            return _read_inner(words, read_type)
        case word:
            raise ValueError(f"{word!r} begins no constraint")


def _read_inner(words: Words, read_type: TypeReader) -> types.Inner:
    words.needs("{")
    partial = words.takes("...")
    if partial:
        words.takes(",")
    lines: list[types.InnerComponent] = []
    while not words.takes("}"):
        name = words.next()
        constraint = read_constraint(words, read_type) if words.sees("(") else None
        presence = next((word.upper() for word in ("present", "absent", "optional") if words.takes(word)), None)
        lines.append(types.InnerComponent(name, constraint, presence))
        if not words.sees("}"):
            words.needs(",")
    return types.Inner(partial, tuple(lines))


def _begins_range(words: Words) -> bool:
    return words.peek().lstrip("-").isdigit() or words.peek() == "min"


def _read_range(words: Words) -> types.Range:
    low = _read_end(words, "min")
    return types.Range(low, _read_end(words, "max") if words.takes("..") else low)


def _read_end(words: Words, open_end: str) -> int | None:
    word = words.next()
    return None if word == open_end else int(word)
