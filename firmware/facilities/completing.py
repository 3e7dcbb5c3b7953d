"""Completion of a user's message: fills in what is missing and may be, and lists the components that are wrong.

A missing component is filled in if the station knows its value (header, own time, own position), or if its type has the
value `unavailable`. Any other missing component is a fault: the station invents no value.
"""

import re

from board.runtime.describe import remedy
from drivers.message import Fault
from drivers.wire.type_tree import Field, Type
from firmware.codec.library import Message
from firmware.facilities.exchange import Ask
from firmware.facilities.paths import joined
from firmware.topics import PLAIN, ROWS

ITS_PDU_HEADER = 3  # components: protocolVersion, messageID, stationID
UNAVAILABLE = "unavailable"
# Units in which the station knows a value, as seconds and degrees.
_PLAIN = {"ms": 1e3, "1e-7 degree": 1e7}
# Types of TS 102 894-1/-2, by the names of both releases.
_STATION_ID = frozenset({"StationID", "StationId"})
_TIMES = frozenset({"TimestampIts"})
_DELTA = "GenerationDeltaTime"  # ITS time modulo 65,536 ms
OWN_POSITION = "referencePosition"  # component; other positions are those of events and of other objects
LATITUDE, LONGITUDE = "latitude", "longitude"
# Members for what a newer edition knows: octets of an extension addition, length of its bitmap.
_EXTENSION = re.compile(r"\[\d*\]")


class Completion:
    """Fills in one message.

    faults  faults found so far.
    """

    def __init__(self, message: Message, ask: Ask) -> None:
        self.faults: list[Fault] = []
        self._message = message
        self._ask = ask

    def complete(self, value: dict[str, object]) -> dict[str, object]:
        """Return the message with its missing components, and without the unknown ones."""
        tree = self._message.type_tree()
        name, header = tree.fields[0].name, tree.fields[0].type.fields
        given = value.get(name, {})
        if self._message.ids and len(header) == ITS_PDU_HEADER and isinstance(given, dict):
            known = (max(self._message.versions), self._message_id(), self._ask.station_id)
            value = value | {name: {field.name: number for field, number in zip(header, known, strict=True)} | given}
        completed = self._value(tree, value, "")
        assert isinstance(completed, dict)
        return completed

    def _message_id(self) -> int:
        """Return the messageID of the envelope's type. Without one, the standard's: a message may have several."""
        ids = self._message.ids
        if self._ask.message_id in ids:
            return self._ask.message_id
        return next((row.number for row in ROWS if row.name == self._message.type and row.number in ids), ids[0])

    def _value(self, kind: Type, value: object, path: str) -> object:
        if kind.kind == "SEQUENCE" and isinstance(value, dict):
            return self._sequence(kind, value, path)
        if kind.kind == "CHOICE" and isinstance(value, dict):
            known = {field.name: field.type for field in kind.fields}
            if len(value) != 1:
                self.faults.append((path, f"{len(value)} alternatives, expected one of {', '.join(known)}", None))
            return {
                name: self._value(known[name], one, joined(path, name)) if name in known else one
                for name, one in list(value.items())[:1]
            }
        if kind.kind == "SEQUENCE OF" and isinstance(value, list) and kind.element is not None:
            return [self._value(kind.element, one, f"{path}[{index}]") for index, one in enumerate(value)]
        return value

    def _sequence(self, kind: Type, value: dict[str, object], path: str) -> dict[str, object]:
        known = {field.name: field for field in kind.fields}
        if path.endswith(OWN_POSITION) and LATITUDE in known and LATITUDE not in value and LONGITUDE not in value:
            value = {**value, **self._own_place(known, path)}
        completed = {}
        for name, one in value.items():
            if name in known:
                completed[name] = self._value(known[name].type, one, joined(path, name))
            elif _EXTENSION.fullmatch(name):
                completed[name] = one
            else:
                self.faults.append((joined(path, name), f"unknown component; {remedy(name, known)}", one))
        for name, field in known.items():
            if name in value or not _is_needed(field):
                continue
            if name in (LATITUDE, LONGITUDE):  # a message without the place that it is about is of no use
                completed[name] = self._fault(field.type, joined(path, name), _expected(field.type, self._ask.form))
            else:
                completed[name] = self._missing(field.type, joined(path, name))
        return completed

    def _own_place(self, known: dict[str, Field], path: str) -> dict[str, object]:
        """Return latitude and longitude of the station. Else add a fault, and return any legal values."""
        ask = self._ask
        if ask.latitude is None or ask.longitude is None:
            self.faults.append((path, "missing: the station does not know its position", None))
            return {name: stand_in(known[name].type, ask.form) for name in (LATITUDE, LONGITUDE)}
        own = {LATITUDE: ask.latitude, LONGITUDE: ask.longitude}
        return {name: self._number(known[name].type, number) for name, number in own.items()}

    def _missing(self, kind: Type, path: str) -> object:
        """Return the value of a missing component. Else add a fault, and return any legal value."""
        ask, names = self._ask, dict(kind.names)
        if kind.name in _STATION_ID:
            return ask.station_id
        if kind.name == _DELTA or kind.name in _TIMES:
            if not ask.its_ms:
                return self._fault(kind, path, "the station does not know the time")
            return self._number(kind, ask.its_ms % 65_536 if kind.name == _DELTA else ask.its_ms)
        if kind.kind == "SEQUENCE":
            return self._sequence(kind, {}, path)
        if UNAVAILABLE in names:
            return names[UNAVAILABLE] if kind.kind == "INTEGER" and ask.form != PLAIN else UNAVAILABLE
        return self._fault(kind, path, _expected(kind, ask.form))

    def _fault(self, kind: Type, path: str, problem: str) -> object:
        self.faults.append((path, f"missing: {problem}", None))
        return stand_in(kind, self._ask.form)

    def _number(self, kind: Type, number: int) -> float:
        return number / _PLAIN.get(kind.unit or "", 1.0) if self._ask.form == PLAIN else number


def is_of_station(kind: Type) -> bool:
    """Return whether a component has a value that the station knows: its stationID, or its time."""
    return kind.name in _STATION_ID or kind.name == _DELTA or kind.name in _TIMES


def stand_in(kind: Type, form: str) -> object:
    """Return a legal value of a simple type; None for any other type."""
    names = dict(kind.names)
    if kind.kind == "ENUMERATED" and names:
        return next(iter(names))
    if kind.kind != "INTEGER":
        return False if kind.kind == "BOOLEAN" else None
    if form == PLAIN and kind.special:
        return kind.special[0]
    low, high, _ = _range(kind, form)
    return next(float(end) if form == PLAIN else int(end) for end in (low, high, "0") if end is not None)


def _range(kind: Type, form: str) -> tuple[str | None, str | None, str]:
    """Return the lowest and highest number of an INTEGER, and their unit."""
    if form == PLAIN and kind.unit:
        return kind.plain_range(kind.unit)
    low, high = (None if end is None else str(end) for end in (kind.low, kind.high))
    return low, high, kind.unit or ""


def _is_needed(field: Field) -> bool:
    return not field.is_optional and field.default is None and not field.addition


def _expected(kind: Type, form: str) -> str:
    names = [field.name for field in kind.fields] or [name for name, _ in kind.names]
    if kind.kind == "INTEGER":
        low, high, unit = _range(kind, form)
        return f"{low} to {high} {unit}".rstrip()
    if names:
        return f"one of {', '.join(names[:10])}{', ...' if len(names) > 10 else ''}"
    return f"a {kind.kind}"
