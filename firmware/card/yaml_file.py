"""YAML as a tree of entries with line numbers."""

import re
from typing import Any, NamedTuple

from board.runtime.toml import show
from firmware.card.note import TOO_DEEP, Note, at, mistake, remark

# Source: netplan, src/parse.c, handle_generic_bool().
TRUE, FALSE = ("true", "on", "yes", "y"), ("false", "off", "no", "n")
KINDS = {"scalar": "text", "sequence": "a list", "mapping": "keys with values"}
MOST_LEFT = 10  # most ignored keys that are named
# Escape of a character from U+0080 to U+00FF; YAML 1.2.2, clause 5.7.
ESCAPED = re.compile(r"\\x[89A-Fa-f][0-9A-Fa-f]")


class Entry(NamedTuple):
    """Key with its value, or item of a list, whose key is its number.

    node     PyYAML's node of the value.
    written  the key as written in the file.
    """

    key: str
    line: int
    node: Any
    written: str = ""

    @property
    def meant(self) -> str:
        """The key; if each octet of its UTF-8 is escaped as a character, the decoded text.

        Raspberry Pi Imager 2.0.10 writes the name of a network so (its issue 1743). Other keys are unchanged, such as
        those with unescaped characters, or "Caf\\xe9", whose octets are not UTF-8.
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
        """Text of a scalar, as written; empty for lists, mappings and null."""
        return _whole(self.node.value) if self.is_text and not self.is_nothing else ""

    @property
    def is_nothing(self) -> bool:
        """True for a key without a value; "" is a value."""
        return bool(self.node.tag.endswith(":null"))


class YamlFile:
    """One YAML document. It adds notes about syntax errors, and about values of another kind than requested."""

    def __init__(self, name: str, text: str, notes: list[Note]) -> None:
        self.name = name
        self._notes = notes
        self._left: list[str] = []
        root = _composed(name, text, notes)
        self._root = Entry("the document", 0, root) if root is not None else None

    def entries(self, entry: Entry | None = None) -> list[Entry]:
        """Return the entries of the document or a mapping. Of duplicate keys the last one counts, as in cloud-init."""
        entry = entry or self._root
        if entry is None or not self._is(entry, "mapping"):
            return []
        found: dict[str, Entry] = {}
        for key, value in entry.node.value:
            if key.id == "scalar":
                written = key.start_mark.buffer[key.start_mark.pointer : key.end_mark.pointer]
                one = Entry(_whole(key.value), key.start_mark.line + 1, value, written)
                if before := found.get(key.value):
                    what = f"{one.key}: duplicate key, first in line {before.line}; the last one is used"
                    self._notes.append(remark(at(self.name, one.line), what, "remove the wrong one"))
                found[key.value] = one
        return list(found.values())

    def items(self, entry: Entry) -> list[Entry]:
        if not self._is(entry, "sequence"):
            return []
        nodes = enumerate(entry.node.value)
        return [Entry(f"{entry.key}[{number}]", node.start_mark.line + 1, node) for number, node in nodes]

    def text(self, entry: Entry) -> str | None:
        return entry.text if entry.is_text or self._is(entry, "scalar") else None

    def flag(self, entry: Entry) -> bool | None:
        """Return whether it is true; None, with a note, if it is neither true nor false."""
        text = self.text(entry)
        if text is not None and text.lower() not in TRUE + FALSE:
            what = f"{entry.key}: {show(text)} is not true or false"
            self._notes.append(mistake(at(self.name, entry.line), what, "write one of them"))
            return None
        return None if text is None else text.lower() in TRUE

    def leave(self, entry: Entry) -> None:
        """Mark an entry as ignored; tell_left() names it."""
        self._left.append(f"{entry.key} (line {entry.line})")

    def tell_left(self) -> None:
        if self._left:
            more = [f"and {count} more"] if (count := len(self._left) - MOST_LEFT) > 0 else []
            self._notes.append(remark(self.name, f"keys ignored: {', '.join(self._left[:MOST_LEFT] + more)}"))

    def _is(self, entry: Entry, wanted: str) -> bool:
        """Return whether an entry has the wanted kind; add a note about another kind, unless it is empty."""
        if entry.node.id == wanted:
            return True
        if entry.text or not entry.is_text:
            what = f"{entry.key} is {KINDS[entry.node.id]}, not {KINDS[wanted]}"
            self._notes.append(mistake(at(self.name, entry.line), what, "compare with Imager's files"))
        return False


def _whole(text: str) -> str:
    """Join surrogate pairs: JSON escapes a character beyond U+FFFF as two halves, RFC 8259, clause 7."""
    return text.encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def _composed(name: str, text: str, notes: list[Note]) -> Any:
    """Return the root node; None for an empty file, or with a note for an invalid one."""
    import yaml

    try:
        return yaml.compose(text, Loader=yaml.SafeLoader)
    except RecursionError:
        notes.append(mistake(name, *TOO_DEEP))
    except (yaml.YAMLError, ValueError) as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        what = getattr(error, "problem", None) or str(error).partition("\n")[0]
        remedy = "compare with the lines around it; YAML is indented by blanks, never by tabs"
        notes.append(mistake(at(name, mark.line + 1 if mark else None), f"is not YAML: {what}", remedy))
    return None
