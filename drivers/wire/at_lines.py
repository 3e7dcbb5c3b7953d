"""Octets of an AT port into lines, whatever stands between them: CR LF, CR CR LF, echo, NULs, rubbish."""

import re
from typing import NamedTuple

# AT+COPS=? of a 5G module in a city: 31 operators, 2 KiB. A longer line is none.
MAX_LINE = 4096  # octets

PROMPT = b">"

_END = re.compile(rb"[\r\n]+")
_UNPRINTABLE = re.compile("[\x01-\x08\x0b-\x1f\x7f\ufffd]")


class Rubbish(NamedTuple):
    """Octets that are no line of text: a control character is in them, no UTF-8, or no end."""

    octets: bytes


class Lines:
    """What came, cut at its ends of line; at most MAX_LINE octets wait for theirs.

    NULs are left out: a modem sends some when its port is opened.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._is_too_long = False

    @property
    def rest(self) -> bytes:
        """What has come of a line that has no end yet."""
        return self._rest

    def feed(self, octets: bytes) -> list[str | Rubbish]:
        """The lines that octets complete, without blanks around them, and without empty ones."""
        *whole, rest = _END.split(self._rest + octets.replace(b"\0", b""))
        found: list[str | Rubbish] = []
        for line in whole:
            if self._is_too_long or len(line) > MAX_LINE:
                found.append(Rubbish(line))
            elif text := line.decode("utf-8", "replace").strip():
                found.append(Rubbish(line) if _UNPRINTABLE.search(text) else text)
            self._is_too_long = False
        if self._is_too_long or len(rest) > MAX_LINE:
            self._is_too_long = True
            found.append(Rubbish(rest))
            rest = b""
        self._rest = rest
        return found

    def clear(self) -> None:
        self._rest = b""
        self._is_too_long = False
