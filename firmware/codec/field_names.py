"""Names of the fields that messages have, so that a slip in one is told before the first message comes."""

from collections.abc import Iterable, Sequence
from itertools import pairwise

from board.describe import remedy
from board.errors import RequestError
from drivers.wire.v2n_type import Type
from firmware.codec.library import Message


class FieldNames:
    """The names of all fields of some messages, and which of them stands right inside which."""

    def __init__(self, messages: Iterable[Message]) -> None:
        self.names: set[str] = set()
        self._inside: set[tuple[str, str]] = set()
        self._seen: set[tuple[str, Type]] = set()
        for message in messages:
            self._collect("", message.type_tree())

    def check(self, asked: Sequence[str]) -> None:
        """Each as fields.chosen() has it. Raises RequestError that names the part that there is not."""
        for text in asked:
            parts = text.strip(".").split(".")
            for part in parts:
                if part not in self.names:
                    raise RequestError(
                        f"{text!r}: no message that is listened to has a field {part}", self._nearest(part)
                    )
            for outer, inner in pairwise(parts):
                if (outer, inner) not in self._inside:
                    within = sorted(name for holder, name in self._inside if holder == outer)
                    raise RequestError(f"{text!r}: {outer} holds no {inner}", remedy(inner, within))

    def _collect(self, holder: str, root: Type) -> None:
        """With a list of what is left: types may be inside themselves."""
        left = [(holder, root)]
        while left:
            holder, found = left.pop()
            if (holder, found) in self._seen:
                continue
            self._seen.add((holder, found))
            for field in found.fields:
                self.names.add(field.name)
                self._inside.add((holder, field.name))
                left.append((field.name, field.type))
            left += [(holder, inner) for _, inner in found.rows]
            if found.element is not None:
                left.append((holder, found.element))

    def _nearest(self, name: str) -> str:
        """Also where only capitals differ; hundreds of names are no help."""
        same = sorted(known for known in self.names if known.lower() == name.lower())
        told = f"did you mean {same[0]}?" if same else remedy(name, sorted(self.names))
        return told if told.startswith("did you mean") else "`captain decode` shows the fields of a message"
