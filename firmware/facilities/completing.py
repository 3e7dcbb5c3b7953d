"""Completion of a user's message: fills in what is missing and may be, and lists the components that are wrong.

A missing component is filled in if the station knows its value (header, own time, own position), or if its type has the
value `unavailable`. Any other missing component is a fault: the station invents no value.
"""

from collections.abc import Iterator

from board.runtime.describe import remedy
from drivers.message import Fault
from drivers.wire.type_tree import Field, Type
from firmware.codec.library import Message
from firmware.facilities.exchange import Ask
from firmware.topics import PLAIN

UNAVAILABLE = "unavailable"
# Units in which the station knows a value, as seconds and degrees.
_PLAIN = {"ms": 1e3, "1e-7 degree": 1e7}
# Types of TS 102 894-1/-2, by the names of both releases.
_STATION_ID = frozenset({"StationID", "StationId"})
_TIMES = frozenset({"TimestampIts"})
_DELTA = "GenerationDeltaTime"  # ITS time modulo 65,536 ms


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
        if self._message.ids and tree.fields[0].type.fields:
            name, header = tree.fields[0].name, tree.fields[0].type
            known = (max(self._message.versions), self._message.ids[0], self._ask.station_id)
            given = value.get(name, {})
            if isinstance(given, dict):
                facts = {field.name: number for field, number in zip(header.fields, known, strict=True)}
                value = value | {name: facts | given}
        completed = self._value(tree, value, "")
        assert isinstance(completed, dict)
        return completed

    def _value(self, kind: Type, value: object, path: str) -> object:
        if kind.kind == "SEQUENCE" and isinstance(value, dict):
            return self._sequence(kind, value, path)
        if kind.kind == "CHOICE" and isinstance(value, dict) and len(value) == 1:
            known = {field.name: field.type for field in kind.fields}
            ((name, one),) = value.items()
            if name in known:
                return {name: self._value(known[name], one, _joined(path, name))}
        if kind.kind == "SEQUENCE OF" and isinstance(value, list) and kind.element is not None:
            return [self._value(kind.element, one, f"{path}[{index}]") for index, one in enumerate(value)]
        return value

    def _sequence(self, kind: Type, value: dict[str, object], path: str) -> dict[str, object]:
        known = {field.name: field for field in kind.fields}
        completed = {}
        for name, one in value.items():
            if name in known:
                completed[name] = self._value(known[name].type, one, _joined(path, name))
            elif name.startswith("["):  # an unknown extension: octets that a newer edition knows
                completed[name] = one
            else:
                self.faults.append((_joined(path, name), f"unknown component; {remedy(name, known)}", one))
        for name, field in known.items():
            if name not in value and _is_needed(field):
                completed[name] = self._missing(field.type, _joined(path, name))
        return completed

    def _missing(self, kind: Type, path: str) -> object:
        """Return the value of a missing component. Else add a fault, and return any legal value."""
        ask, names = self._ask, dict(kind.names)
        if kind.name in _STATION_ID:
            return ask.station_id
        if kind.name == _DELTA or kind.name in _TIMES:
            if not ask.its_ms:
                return self._fault(kind, path, "the station does not know the time")
            return self._number(kind, ask.its_ms % 65_536 if kind.name == _DELTA else ask.its_ms)
        if kind.kind == "SEQUENCE" and {"latitude", "longitude"} <= {field.name for field in kind.fields}:
            if ask.latitude is None or ask.longitude is None:
                return self._fault(kind, path, "the station does not know its position")
            types = {field.name: field.type for field in kind.fields}
            own = {"latitude": ask.latitude, "longitude": ask.longitude}
            return self._sequence(kind, {name: self._number(types[name], number) for name, number in own.items()}, path)
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


def type_at(kind: Type, path: str) -> Type | None:
    """Return the type at a path of an error, such as "cam.camParameters.x[0].y"; None if the path leaves the tree."""
    for name in _steps(path):
        if name.isdecimal():
            found = kind.element
        else:
            found = next((field.type for field in kind.fields if field.name == name), None)
        if found is None:
            return None
        kind = found
    return kind


def replace_at(value: object, path: str, new: object) -> bool:
    """Replace the value at a path. Return False if the path leads nowhere."""
    *steps, last = _steps(path)
    for name in steps:
        value = _inside(value, name)
    if isinstance(value, dict) and last in value:
        value[last] = new
        return True
    if isinstance(value, list) and last.isdecimal() and int(last) < len(value):
        value[int(last)] = new
        return True
    return False


def value_at(value: object, path: str) -> object:
    for name in _steps(path):
        value = _inside(value, name)
    return value


def stand_in(kind: Type, form: str) -> object:
    """Return a legal value of a simple type; None for any other type."""
    names = dict(kind.names)
    if kind.kind == "ENUMERATED" and names:
        return next(iter(names))
    if kind.kind != "INTEGER":
        return False if kind.kind == "BOOLEAN" else None
    if form == PLAIN:
        low, high, _ = kind.plain_range(kind.unit)
        return kind.special[0] if kind.special else float(low or high or 0)
    return next(number for number in (kind.low, kind.high, 0) if number is not None)


def _is_needed(field: Field) -> bool:
    return not field.is_optional and field.default is None and not field.addition


def _expected(kind: Type, form: str) -> str:
    names = [field.name for field in kind.fields] or [name for name, _ in kind.names]
    if kind.kind == "INTEGER":
        low, high, unit = kind.plain_range(kind.unit) if form == PLAIN else (kind.low, kind.high, kind.unit)
        return f"{low} to {high} {unit or ''}".rstrip()
    if names:
        return f"one of {', '.join(names[:10])}{', ...' if len(names) > 10 else ''}"
    return f"a {kind.kind}"


def _joined(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


def _steps(path: str) -> Iterator[str]:
    return iter(path.replace("[", ".").replace("]", "").split("."))


def _inside(value: object, name: str) -> object:
    if isinstance(value, dict):
        return value.get(name)
    if isinstance(value, list) and name.isdecimal() and int(name) < len(value):
        return value[int(name)]
    return None
