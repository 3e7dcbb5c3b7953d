"""YAML as a tree of entries that know their lines; nothing in it is made into an object."""

from typing import Any, NamedTuple

from firmware.box.note import Note, at, mistake, remark

TRUE = ("true", "yes", "on")


class Entry(NamedTuple):
    """A key with its value, or an item of a list, whose key is its number. node: PyYAML's."""

    key: str
    line: int
    node: Any

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

    @property
    def is_true(self) -> bool:
        return self.text.lower() in TRUE


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
            self._wrong(entry, "keys with values")
            return []
        found: dict[str, Entry] = {}
        for key, value in node.value:
            one = Entry(str(key.value), key.start_mark.line + 1, value)
            if one.key in found:
                what = f"{one.key} stands there a second time, first in line {found[one.key].line}"
                self._notes.append(mistake(at(self.name, one.line), what, "remove one"))
            found.setdefault(one.key, one)
        return list(found.values())

    def items(self, entry: Entry) -> list[Entry]:
        if entry.node.id != "sequence":
            if entry.text or not entry.is_text:
                self._wrong(entry, "a list, each line with a - before it")
            return []
        return [
            Entry(f"{entry.key}[{number}]", node.start_mark.line + 1, node)
            for number, node in enumerate(entry.node.value)
        ]

    def text(self, entry: Entry) -> str | None:
        if not entry.is_text:
            self._wrong(entry, "text")
            return None
        return entry.text

    def leave(self, entry: Entry) -> None:
        """Not taken: tell_left() names it."""
        self._left.append(f"{entry.key} (line {entry.line})")

    def tell_left(self) -> None:
        if self._left:
            self._notes.append(remark(self.name, f"not taken: {', '.join(self._left)}"))

    def _wrong(self, entry: Entry | None, wanted: str) -> None:
        place, what = (at(self.name, entry.line), f"{entry.key} is") if entry else (self.name, "this is")
        self._notes.append(mistake(place, f"{what} not {wanted}"))


def _composed(name: str, text: str, notes: list[Note]) -> Any:
    """The root node; None of an empty file and of one with mistakes."""
    import yaml

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
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
        what = f"is not YAML: {error.problem or error.context}"
        remedy = "indent by blanks: YAML takes no tab" if "'\\t'" in what else "compare with the lines around it"
        notes.append(mistake(at(name, mark.line + 1 if mark else None), what, remedy))
    except (yaml.YAMLError, ValueError) as error:  # a character that YAML does not have, a number beyond all of them
        notes.append(mistake(name, f"is not YAML: {str(error).splitlines()[0]}", "save it as plain text"))
    except RecursionError:
        notes.append(mistake(name, "is nested too deep", "is it the right file?"))
    return None
