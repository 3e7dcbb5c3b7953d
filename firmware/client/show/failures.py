"""Failures of items: prints three of each kind on standard error, then their count."""

import re
import sys
from dataclasses import dataclass
from types import TracebackType

from board.runtime.errors import StationError
from firmware.printable import clean, folded

TOLD = 3  # failures of each kind that are printed in full
MOST_KINDS = 12  # limit of kinds: a malformed capture would produce nearly one per frame
MOST_COMPARED = 300  # characters compared: a value inside a message may have a megabyte

# Parts in which failures of one kind differ: quoted values, paths of fields and files, numbers, hexadecimal digits.
_VALUE = re.compile(r"'[^']*'|\"[^\"]*\"|[\w/[\]-]+(?:\.[\w/[\]-]+)+|\b[\w.-]*\d[\w.-]*")
_OTHERS = "others"


@dataclass
class _Kind:
    """Failures of one kind.

    count  number of all of them.
    last   the most recent one that was not printed.
    hint   hint printed last.
    """

    count: int = 0
    last: str = ""
    hint: str = ""


class Failures:
    """Prints failures, at most TOLD of each kind; counts the rest and prints the count when the context ends.

    A hint is printed again only if it differs from the previous one of its kind.
    """

    def __init__(self) -> None:
        self._kinds: dict[str, _Kind] = {}

    def __enter__(self) -> "Failures":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Print the counts, also after Ctrl-C."""
        for one in self._kinds.values():
            if one.last:
                _say(
                    f"{one.count - TOLD} more of this kind, the last: {one.last}" if one.count > TOLD + 1 else one.last
                )
        self._kinds.clear()

    def report(self, error: StationError) -> None:
        """Print or count a failure; its message begins with its place."""
        self._tell(error.message, clean(error.hint))

    def warn(self, text: str) -> None:
        """Print or count a warning about a valid but surprising item; the text begins with its place."""
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
    sys.stdout.flush()  # keeps standard output and standard error in order
    print(folded(f"captain: {text}", sys.stderr), file=sys.stderr, flush=True)
