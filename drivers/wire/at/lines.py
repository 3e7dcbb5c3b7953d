"""Lines of an AT port from octets: splits at CR LF, drops NULs, finds garbage."""

import re
from typing import NamedTuple

# AT+COPS=? of a 5G module in a city listed 31 operators in 2 KiB. A line above this limit is garbage.
MAX_LINE = 4096  # octets of a line

PROMPT = b">"

_END = re.compile(rb"[\r\n]+")
_UNPRINTABLE = re.compile("[\x01-\x08\x0b-\x1f\x7f\ufffd]")


class Rubbish(NamedTuple):
    """Octets that are not a line of text: with control characters, not UTF-8, or too long."""

    octets: bytes


class Lines:
    """Splits the octets of a port into lines; keeps at most MAX_LINE octets of an incomplete line.

    NULs are removed: a modem sends some when its port is opened.
    """

    def __init__(self) -> None:
        self._rest = b""
        self._is_too_long = False

    @property
    def rest(self) -> bytes:
        """Octets of the incomplete last line."""
        return self._rest

    def feed(self, octets: bytes) -> list[str | Rubbish]:
        """Return the lines that the octets complete, stripped of blanks, without empty lines."""
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
