"""Fields of decoded messages: a summary for tables, and fields chosen by name."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final

from board.runtime.describe import remedy
from board.runtime.errors import RequestError
from drivers.wire.type_tree import Type
from firmware.codec.library import Message, Step

_INDEX = re.compile(r"\[\d+\]")

# Values that mean "unavailable", with units, from the DEs of the same names (ETSI TS 102 894-2 v1.3.1 and v2.4.1).
LATITUDE_UNAVAILABLE: Final = 900000001  # 1e-7 degree
LONGITUDE_UNAVAILABLE: Final = 1800000001
SPEED_UNAVAILABLE: Final = 16383  # 0.01 m/s
HEADING_UNAVAILABLE: Final = 3601  # 0.1 degree


def glance(message: Message, octets: bytes) -> str:
    """Return a short summary of a message, by its type. Raises ValueError if it does not decode."""
    value = message.decode(octets)
    parts = (look(value, message, octets) for look in LOOKS.get(message.type, (_position,)))
    return " ".join(part for part in parts if part)


def chosen(steps: Iterable[Step], names: Sequence[str]) -> dict[str, str]:
    """Return the values below any of the names, by path; each as text with its unit.

    names  "speedValue", "referencePosition.latitude", "header": one or more trailing parts of a path, without indices.
    """
    wanted = [f".{name.strip('.')}." for name in names]
    found: dict[str, str] = {}
    for step in steps:
        path = f".{_INDEX.sub('', step.path)}."
        if step.what == "value" and any(name in path for name in wanted):
            found[step.path] = step.text
    return found


def brief(values: Mapping[str, str], names: Sequence[str]) -> dict[str, str]:
    """Return the values of chosen(), each under the end of its path from the matching name on.

    If two of these ends are equal, all values have their whole paths.
    """
    ends = [_end(path, names) for path in values]
    return dict(zip(ends, values.values(), strict=True)) if len(set(ends)) == len(ends) else dict(values)


def _end(path: str, names: Sequence[str]) -> str:
    parts = path.split(".")
    for at in range(len(parts)):
        rest = ".".join(parts[at:])
        if any(f"{_INDEX.sub('', rest)}.".startswith(f"{name.strip('.')}.") for name in names):
            return rest
    return path


class FieldNames:
    """Field names of some messages and their nesting, to report a misspelt name before the first message arrives."""

    def __init__(self, messages: Iterable[Message]) -> None:
        self.names: set[str] = set()
        self._inside: set[tuple[str, str]] = set()
        self._seen: set[tuple[str, Type]] = set()
        for message in messages:
            self._collect("", message.type_tree())

    def check(self, asked: Sequence[str]) -> None:
        """Check names in the form of chosen(). Raises RequestError with the unknown part."""
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
        """Collect the names with a work list, because types may be recursive."""
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
        """Return the nearest known name, ignoring case; a list of hundreds of names does not help."""
        same = sorted(known for known in self.names if known.lower() == name.lower())
        told = f"did you mean {same[0]}?" if same else remedy(name, sorted(self.names))
        return told if told.startswith("did you mean") else "`captain decode` shows the fields of a message"


# -- summaries by type


def _position(value: object, message: Message, octets: bytes) -> str:
    for place in _members(value):
        latitude, longitude = place.get("latitude", place.get("lat")), place.get("longitude", place.get("long"))
        if isinstance(latitude, int) and isinstance(longitude, int):
            if latitude == LATITUDE_UNAVAILABLE or longitude == LONGITUDE_UNAVAILABLE:
                return "no position"
            return f"{latitude / 1e7:.5f} {longitude / 1e7:.5f}"
    return ""


def _speed(value: object, message: Message, octets: bytes) -> str:
    speed = _first(value, "speedValue")
    if not isinstance(speed, int):
        return ""
    return "speed?" if speed == SPEED_UNAVAILABLE else f"{speed / 100:.1f} m/s"


def _heading(value: object, message: Message, octets: bytes) -> str:
    heading = _first(value, "headingValue")
    if not isinstance(heading, int) or heading == HEADING_UNAVAILABLE:
        return ""
    return f"{heading / 10:.0f} deg"


def _cause(value: object, message: Message, octets: bytes) -> str:
    if _first(value, "termination") is not None:
        return "terminated"
    coded = _first(value, "ccAndScc")
    if isinstance(coded, tuple):  # Release 2 has a CHOICE here; the name of its alternative contains cause and number
        return f"{coded[0]}/{coded[1]}"
    event = _first(value, "eventType")
    if not isinstance(event, dict):
        return ""
    told = next(iter(chosen(message.explain(octets), ("eventType.causeCode",)).values()), "")
    _, named, name = told.rstrip(")").partition(" (")
    return f"{name if named else 'cause ' + str(event.get('causeCode'))}/{event.get('subCauseCode')}"


def _count(key: str, of_what: str) -> Callable[[object, Message, bytes], str]:
    """Return a function that summarises a list by its length."""

    def look(value: object, message: Message, octets: bytes) -> str:
        found = _first(value, key)
        return f"{len(found)} {of_what}" if isinstance(found, list) else ""

    return look


LOOKS: dict[str, tuple[Callable[[object, Message, bytes], str], ...]] = {
    "cam": (_position, _speed, _heading),
    "vam": (_position, _speed, _heading),
    "mcm": (_position, _speed, _heading),
    "denm": (_cause, _position),
    "cpm": (_position, _count("perceivedObjects", "objects"), _count("perceivedObjectContainer", "objects")),
    "spatem": (_count("intersections", "intersections"),),
    "mapem": (_count("intersections", "intersections"), _position),
}


def _members(value: object) -> Iterator[Mapping[str, object]]:
    """Yield every SEQUENCE in a decoded value, outer ones first.

    A decoded CHOICE is a pair of alternative and value.
    """
    if isinstance(value, dict):
        yield value
        for member in value.values():
            yield from _members(member)
    elif isinstance(value, list):
        for item in value:
            yield from _members(item)
    elif isinstance(value, tuple) and len(value) == 2 and isinstance(value[0], str):
        yield from _members(value[1])


def _first(value: object, key: str) -> object:
    return next((members[key] for members in _members(value) if key in members), None)
