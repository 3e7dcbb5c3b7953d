"""Fields of a modem's line, such as `+COPS: 0,0,"Telekom, DE",7`."""

import re

from board.runtime.errors import ProtocolError

_FIELD = re.compile(r'\s*(?:"([^"]*)"|([^,"]*))\s*(,|$)')


def fields(line: str, prefix: str) -> list[str]:
    """Return the fields after a prefix such as `+COPS`, without quotes; missing ones are empty.

    Raises ProtocolError if the line has another prefix, an unterminated quote, or text after a quote.
    """
    if not line.startswith(prefix) or line[len(prefix) : len(prefix) + 1] != ":":
        raise ProtocolError(f"not a {prefix} line: {line[:60]!r}")
    rest = line[len(prefix) + 1 :].strip()
    found, place, goes_on = [], 0, True
    while goes_on:
        match = _FIELD.match(rest, place)
        if match is None:
            raise ProtocolError(f"{line[:60]!r}: a quote without its end, or octets behind one")
        found.append(match[1] if match[1] is not None else match[2].strip())
        place, goes_on = match.end(), match[3] == ","
    return found


def number(text: str, line: str, base: int = 10) -> int:
    """Return a field as a number. Raises ProtocolError if it is invalid in this base."""
    try:
        return int(text, base)
    except ValueError as error:
        raise ProtocolError(f"{line[:80]!r}: invalid number of base {base}: {text[:20]!r}") from error


def number_or_none(text: str, line: str, base: int = 10) -> int | None:
    """Return a field as a number; None if it is empty."""
    return number(text, line, base) if text else None
