"""Failures of a list's items: three of each kind on standard error, then their count."""

import re
import sys
from dataclasses import dataclass
from types import TracebackType

from board.errors import StationError
from firmware.printable import clean

TOLD = 3  # of each kind, one by one
MOST_KINDS = 12  # a malformed capture has nearly as many as frames
MOST_COMPARED = 300  # characters of a message: a value in it may be a megabyte

# Parts that differ between failures of one kind: quoted values, paths of fields and files, numbers, hexadecimal digits.
_VALUE = re.compile(r"'[^']*'|\"[^\"]*\"|[\w/[\]-]+(?:\.[\w/[\]-]+)+|\b[\w.-]*\d[\w.-]*")
_OTHERS = "others"


@dataclass
class _Kind:
    """count  of all. last: the most recent one that was not reported. hint: the one reported last."""

    count: int = 0
    last: str = ""
    hint: str = ""


class Failures:
    """Reports failures; the rest of each kind are counted, and the count is reported at the end of the context.

    A hint is reported once, unless the next failure of the kind has another.
    """

    def __init__(self) -> None:
        self._kinds: dict[str, _Kind] = {}

    def __enter__(self) -> "Failures":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Report the counts, also after Ctrl-C."""
        for one in self._kinds.values():
            if one.last:
                _say(
                    f"{one.count - TOLD} more of this kind, the last: {one.last}" if one.count > TOLD + 1 else one.last
                )
        self._kinds.clear()

    def tell(self, error: StationError) -> None:
        """Report a failure, whose message begins with its place, or count it."""
        self._tell(error.message, clean(error.hint))

    def warn(self, text: str) -> None:
        """Report a valid but surprising item, or count it; text begins with its place."""
        self._tell(text, "", "warning: ")

    def _tell(self, message: str, hint: str, head: str = "") -> None:
        text = clean(message)
        kind = self._kind(head + message)
        kind.count += 1
        if kind.count > TOLD:
            kind.last = head + text
            return
        _say(head + text + (f"\n  ({hint})" if hint != kind.hint else ""))
        kind.hint = hint

    def _kind(self, message: str) -> _Kind:
        place, _, rest = message.partition(": ")
        key = _VALUE.sub("", (rest or place)[:MOST_COMPARED])
        if key not in self._kinds and len(self._kinds) >= MOST_KINDS:
            key = _OTHERS
        return self._kinds.setdefault(key, _Kind())


def _say(text: str) -> None:
    sys.stdout.flush()  # what was printed before the failure comes before it
    print(f"captain: {text}", file=sys.stderr, flush=True)
