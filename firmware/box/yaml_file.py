"""YAML as a tree of entries that know their lines; nothing in it is made into an object."""

import re
from typing import Any, NamedTuple

from board.toml import show
from firmware.box.note import Note, at, mistake, remark

# Source: netplan, src/parse.c, handle_generic_bool().
TRUE, FALSE = ("true", "on", "yes", "y"), ("false", "off", "no", "n")
KINDS = {"scalar": "text", "sequence": "a list", "mapping": "keys with values"}
DEEP, ALIAS = "is nested too deep", "has an alias, which is not taken"
# What is YAML and still refused. A hundred aliases of a hundred aliases are a million entries.
REFUSED = {DEEP: "is it the right file?", ALIAS: "write in its place what it stands for"}
MOST_LEFT = 10  # keys that are not taken and named
# Of a letter from U+0080 to U+00FF; YAML 1.2.2, clause 5.7.
ESCAPED = re.compile(r"\\x[89A-Fa-f][0-9A-Fa-f]")


class Entry(NamedTuple):
    """A key with its value, or an item of a list, whose key is its number. node: PyYAML's.

    written  the key as it stands in the file.
    """

    key: str
    line: int
    node: Any
    written: str = ""

    @property
    def meant(self) -> str:
        """The key; where each octet of its UTF-8 is escaped as a letter, the text of these octets.

        Raspberry Pi Imager 2.0.10 writes the name of a network so (its issue 1743). Letters that the file has
        as they are, or that are no UTF-8 as octets, such as "Caf\\xe9", are left alone.
        """
        strange = sum(not letter.isascii() for letter in self.key)
        if not strange or len(ESCAPED.findall(self.written)) != strange:
            return self.key
        try:
            return self.key.encode("latin-1").decode()
        except UnicodeError:
            return self.key

    @property
    def is_text(self) -> bool:
        return bool(self.node.id == "scalar")

    @property
    def text(self) -> str:
        """Of a scalar, as it is written; empty for the rest and for nothing."""
        return str(self.node.value) if self.is_text and not self.is_nothing else ""

    @property
    def is_nothing(self) -> bool:
        """A key without a value; "" is one."""
        return bool(self.node.tag.endswith(":null"))


class YamlFile:
    """One document; its mistakes are noted, and what is asked for where something else stands is noted too."""

    def __init__(self, name: str, text: str, notes: list[Note]) -> None:
        self.name = name
        self._notes = notes
        self._left: list[str] = []
        self._root = _composed(name, text, notes)

    def entries(self, entry: Entry | None = None) -> list[Entry]:
        """Of the document, or of a mapping in it."""
        node = entry.node if entry else self._root
        if node is None or (entry and entry.is_text and not entry.text):
            return []
        if node.id != "mapping":
            place, name = (at(self.name, entry.line), entry.key) if entry else (self.name, "this")
            self._wrong(place, name, KINDS[node.id], "keys with values", "write key: value, each in a line of its own")
            return []
        found: dict[str, Entry] = {}
        for key, value in node.value:
            if key.id != "scalar":
                self._wrong(at(self.name, key.start_mark.line + 1), "a key", KINDS[key.id], "text", "write key: value")
                continue
            written = key.start_mark.buffer[key.start_mark.pointer : key.end_mark.pointer]
            one = Entry(str(key.value), key.start_mark.line + 1, value, written)
            if one.key in found:
                what = f"{one.key} stands there a second time, first in line {found[one.key].line}"
                self._notes.append(mistake(at(self.name, one.line), what, "remove one"))
            found.setdefault(one.key, one)
        return list(found.values())

    def items(self, entry: Entry) -> list[Entry]:
        if entry.node.id != "sequence":
            if entry.text or not entry.is_text:
                kind = show(entry.text) if entry.is_text else KINDS[entry.node.id]
                remedy = "write each in a line of its own, with a - before it"
                self._wrong(at(self.name, entry.line), entry.key, kind, "a list", remedy)
            return []
        return [
            Entry(f"{entry.key}[{number}]", node.start_mark.line + 1, node)
            for number, node in enumerate(entry.node.value)
        ]

    def text(self, entry: Entry) -> str | None:
        if not entry.is_text:
            kind = KINDS[entry.node.id]
            self._wrong(at(self.name, entry.line), entry.key, kind, "text", "write one value there")
            return None
        return entry.text

    def flag(self, entry: Entry) -> bool | None:
        """Whether it is true; None of what is neither true nor false."""
        text = self.text(entry)
        if text is not None and text.lower() not in TRUE + FALSE:
            what = f"{entry.key} is {show(text)}, which is neither true nor false"
            self._notes.append(mistake(at(self.name, entry.line), what, "write one of them"))
            return None
        return None if text is None else text.lower() in TRUE

    def leave(self, entry: Entry) -> None:
        """Not taken: tell_left() names it."""
        self._left.append(f"{entry.key} (line {entry.line})")

    def tell_left(self) -> None:
        if self._left:
            more = [f"and {count} more"] if (count := len(self._left) - MOST_LEFT) > 0 else []
            self._notes.append(remark(self.name, f"not taken: {', '.join(self._left[:MOST_LEFT] + more)}"))

    def _wrong(self, place: str, name: str, kind: str, wanted: str, remedy: str) -> None:
        self._notes.append(mistake(place, f"{name} is {kind}, not {wanted}", remedy))


def _composed(name: str, text: str, notes: list[Note]) -> Any:
    """The root node; None of an empty file and of one with mistakes."""
    import yaml

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        def get_single_node(self) -> Any:
            try:
                return super().get_single_node()
            except RecursionError as error:
                raise yaml.MarkedYAMLError(problem=DEEP, problem_mark=self.get_mark()) from error

        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                raise yaml.MarkedYAMLError(problem=ALIAS, problem_mark=self.peek_event().start_mark)
            return super().compose_node(parent, index)

        def compose_scalar_node(self, anchor: Any) -> Any:
            """With each letter whole: JSON escapes one beyond U+FFFF as two halves, RFC 8259, clause 7."""
            node = super().compose_scalar_node(anchor)
            try:
                node.value = node.value.encode("utf-16", "surrogatepass").decode("utf-16")
            except UnicodeDecodeError as error:
                what = "found half of a letter without its other half"
                raise yaml.MarkedYAMLError(problem=what, problem_mark=node.start_mark) from error
            return node

    try:
        return yaml.compose(text, Loader=Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        what = str(error.problem or error.context)
        remedy = REFUSED.get(what)
        if remedy is None:
            what = f"is not YAML: {what}"
            remedy = "indent by blanks: YAML takes no tab" if "'\\t'" in what else "compare with the lines around it"
        notes.append(mistake(at(name, mark.line + 1 if mark else None), what, remedy))
    except (yaml.YAMLError, ValueError) as error:  # a character that YAML does not have, a number beyond all of them
        notes.append(mistake(name, f"is not YAML: {str(error).splitlines()[0]}", "save it as plain text"))
    return None
