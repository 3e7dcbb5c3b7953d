"""JSON in SI units to values of the message library: the inverse of si.py.

An open type may also be inside an object with the name of its type, as newer versions of Vanetza-NAP write it.
"""

from collections.abc import Callable
from typing import Any, NoReturn

from drivers.wire.type_tree import Type
from drivers.wire.v2n.payload.json_values import KINDS, shown
from drivers.wire.v2n.payload.si import ConversionError, element_of, grouped_fields, row_of
from drivers.wire.v2n.payload.units import UNITS

LARGEST = 1 << 63  # above every integer in messages


# Vanetza-NAP's examples give the width of a lane in metres, 3.25; the ASN.1 value is an integer.
_IN_METRES = {"LaneWidth": 100, "IviLaneWidth": 100}  # ASN.1 units of 0.01 m per metre


def from_json(kind: Type, value: Any, path: str, note: Callable[[str], None] = lambda text: None) -> Any:
    """Return the value for the message library, which checks ranges itself. Raises ConversionError for invalid JSON.

    note  called with a text if a value was in another unit.
    """
    return _Reading(note).value(kind, value, path)


class _Reading:
    """Conversion of one message; counts its values in the order of the JSON."""

    def __init__(self, note: Callable[[str], None]) -> None:
        self._count = 0
        self._note = note

    def value(self, kind: Type, value: Any, path: str) -> Any:
        """Return the value for the message library, which checks ranges. Raises ConversionError for invalid JSON."""
        self._count += 1
        match kind.kind:
            case "INTEGER":
                return self._integer(kind, value, path)
            case "ENUMERATED":
                return self._enumerated(kind, value, path)
            case "SEQUENCE":
                return self._sequence(kind, self._want(value, dict, path), path)
            case "SEQUENCE OF":
                element = element_of(kind)
                return [
                    self.value(element, item, f"{path}[{at}]") for at, item in enumerate(self._want(value, list, path))
                ]
            case "CHOICE":
                return self._alternative(kind, self._want(value, dict, path), path)
            case "BIT STRING":
                return self._bit_string(kind, value, path)
            case "OCTET STRING":
                return self._octets(self._want(value, str, path), path)
            case "BOOLEAN":
                return self._want(value, bool, path)
            case "NULL":
                return None
        return self._want(value, str, path)

    def _sequence(self, kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
        fields = grouped_fields(kind)
        groups = {group for _, group in fields if group}
        given: dict[str, Any] = {}
        for name, item in value.items():
            given.update(self._want(item, dict, f"{path}.{name}") if name in groups else {name: item})
        known = {field.name: field for field, _ in fields}
        for name in given:
            if name not in known:
                self._no(f"{path}.{name}", f"unknown member; known: {', '.join(known)}")
        # An open type is converted after the number that identifies its type.
        later = sorted(given, key=lambda name: known[name].type.kind == "open type")
        found: dict[str, Any] = {}
        for name in later:
            field, place = known[name], f"{path}.{name}"
            if field.type.kind == "open type":
                found[name] = self._from_opened(field.type, found, place, given[name])
            else:
                found[name] = self.value(field.type, given[name], place)
        return found

    def _alternative(self, kind: Type, value: dict[str, Any], path: str) -> tuple[str, Any]:
        if len(value) != 1:
            self._no(
                path, f"{len(value)} members; a CHOICE has one of {', '.join(field.name for field in kind.fields)}"
            )
        ((name, chosen),) = value.items()
        for field in kind.fields:
            if field.name == name:
                return name, self.value(field.type, chosen, f"{path}.{name}")
        return self._no(
            f"{path}.{name}", f"unknown alternative; known: {', '.join(field.name for field in kind.fields)}"
        )

    def _from_opened(self, kind: Type, siblings: dict[str, Any], path: str, value: Any) -> Any:
        row = row_of(kind, siblings, path)
        if isinstance(value, dict) and list(value) == [row.name]:
            return self.value(row, value[row.name], f"{path}.{row.name}")
        return self.value(row, value, path)

    def _integer(self, kind: Type, value: Any, path: str) -> int:
        if type(value) not in (int, float):
            self._no(path, f"{shown(value)} is not a number")
        if not -LARGEST < value < LARGEST:  # also refuses infinity
            self._no(path, f"{shown(value)} is out of range")
        name = kind.name or ""
        if name in _IN_METRES and value != int(value):
            width: int = round(value * _IN_METRES[name])
            read = f"{shown(value)} read as {shown(value)} m (ASN.1 value {width})"
            self._note(f"{path}: {read}; write an integer for units of 0.01 m")
            return width
        scale, themselves = UNITS.get(name, (1, frozenset()))
        if scale != 1 and value not in themselves:
            number: int = round(value * scale)
            return number
        if value != int(value):
            self._no(path, f"{shown(value)} is not an integer")
        return int(value)

    def _enumerated(self, kind: Type, value: Any, path: str) -> str | int:
        number = self._integer(kind, value, path)
        for name, known in kind.names:
            if known == number:
                return name
        return self._no(
            path, f"unknown value {number}; known: {', '.join(f'{known} {name}' for name, known in kind.names)}"
        )

    def _bit_string(self, kind: Type, value: Any, path: str) -> tuple[bytes, int]:
        if not kind.names:
            return self._unnamed_bits(kind, value, path)
        known = dict(kind.names)
        number = highest = 0
        for name, is_set in self._want(value, dict, path).items():
            if name not in known:
                self._no(f"{path}.{name}", f"unknown bit; known: {', '.join(known)}")
            if self._want(is_set, bool, f"{path}.{name}"):
                number |= 1 << known[name]
                highest = max(highest, known[name] + 1)
        size = max(kind.low or 0, highest)
        octets = bytearray(-(-size // 8))
        for at in range(size):
            octets[at // 8] |= (number >> at & 1) << (7 - at % 8)
        return bytes(octets), size

    def _unnamed_bits(self, kind: Type, value: Any, path: str) -> tuple[bytes, int]:
        if kind.low == kind.high and value == {}:
            return bytes(-(-(kind.low or 0) // 8)), kind.low or 0
        if kind.low == kind.high:
            return self._octets(self._want(value, str, path), path), kind.low or 0
        table = self._want(value, dict, path)
        octets = self._octets(self._want(table.get("value"), str, f"{path}.value"), f"{path}.value")
        length = self._want(table.get("length"), int, f"{path}.length")
        if not 0 <= length <= 8 * len(octets):
            self._no(f"{path}.length", f"{shown(length)} bits are not in {len(octets)} octets")
        return octets, length

    def _octets(self, digits: str, path: str) -> bytes:
        try:
            return bytes.fromhex(digits)
        except ValueError:
            return self._no(path, f"{shown(digits)} is not hexadecimal digits")

    def _want(self, value: Any, kind: type, path: str) -> Any:
        if type(value) is not kind:
            self._no(path, f"{shown(value)} is not {KINDS[kind]}")
        return value

    def _no(self, path: str, why: str) -> NoReturn:
        raise ConversionError(path, why, self._count)
