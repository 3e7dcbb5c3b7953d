"""The fields of a line such as `+COPS: 0,0,"Telekom, DE",7`."""

import re

from board.errors import ProtocolError

_FIELD = re.compile(r'\s*(?:"([^"]*)"|([^,"]*))\s*(,|$)')


def fields(line: str, prefix: str) -> list[str]:
    """The fields behind a prefix (`+COPS`), without their quotes; absent ones are empty.

    Raises ProtocolError where the line has another prefix, or a quote without its end.
    """
    if not line.startswith(prefix) or line[len(prefix) : len(prefix) + 1] != ":":
        raise ProtocolError(f"{line[:60]!r} is no {prefix} line")
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
    """A field as a number. Raises ProtocolError."""
    try:
        return int(text, base)
    except ValueError as error:
        raise ProtocolError(f"{line[:80]!r}: {text[:20]!r} is no number of base {base}") from error


def number_or_none(text: str, line: str, base: int = 10) -> int | None:
    """A field that may be absent."""
    return number(text, line, base) if text else None
