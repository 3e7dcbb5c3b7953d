"""Values of the message library as JSON in SI units, and back: the form of Vanetza-NAP.

SEQUENCE       an object; extension addition groups are objects `ext1`, `ext2` in it
SEQUENCE OF    an array
CHOICE         an object with one member
ENUMERATED     the number
BIT STRING     an object of booleans where bits have names; else hexadecimal digits, with a length where that varies
OCTET STRING   hexadecimal digits
open type      an object whose one member has the type's name
INTEGER        a number, in SI units for the types of v2n_payload_units

Source: the examples and vanetza/asn1/rj of nap-it/vanetza-nap.
"""

import math
from collections.abc import Iterator
from typing import Any, NoReturn

from drivers.wire.v2n_payload_json import KINDS, shown
from drivers.wire.v2n_payload_units import UNITS
from drivers.wire.v2n_type import Field, Type

LARGEST = 1 << 63  # no integer of a message is larger


class ConversionError(ValueError):
    """A value that has no counterpart on the other side."""

    def __init__(self, path: str, why: str) -> None:
        super().__init__(f"{path}: {why}")
        self.path = path


def to_json(kind: Type, value: Any, path: str) -> Any:
    """JSON of a value of the message library. Raises ConversionError."""
    match kind.kind:
        case "INTEGER":
            scale, themselves = UNITS.get(kind.name or "", (1, ()))
            return value if scale == 1 or value in themselves else value / scale
        case "ENUMERATED":
            return dict(kind.names).get(value, value)
        case "SEQUENCE":
            return _object(kind, value, path)
        case "SEQUENCE OF":
            element = _element(kind)
            return [to_json(element, item, f"{path}[{at}]") for at, item in enumerate(value)]
        case "CHOICE":
            return _choice(kind, value, path)
        case "BIT STRING":
            return _bits(kind, value, path)
        case "OCTET STRING":
            return value.hex().upper()
    return value  # BOOLEAN, NULL and character strings


def from_json(kind: Type, value: Any, path: str) -> Any:
    """A value for the message library. Ranges are its business. Raises ConversionError."""
    match kind.kind:
        case "INTEGER":
            return _integer(kind, value, path)
        case "ENUMERATED":
            return _enumerated(kind, value, path)
        case "SEQUENCE":
            return _sequence(kind, _want(value, dict, path), path)
        case "SEQUENCE OF":
            element = _element(kind)
            return [from_json(element, item, f"{path}[{at}]") for at, item in enumerate(_want(value, list, path))]
        case "CHOICE":
            return _alternative(kind, _want(value, dict, path), path)
        case "BIT STRING":
            return _bit_string(kind, value, path)
        case "OCTET STRING":
            return _octets(_want(value, str, path), path)
        case "BOOLEAN":
            return _want(value, bool, path)
        case "NULL":
            return None
    return _want(value, str, path)


def _object(kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    left = set(value)
    for field, group in _fields(kind):
        if field.name not in value:
            continue
        left.discard(field.name)
        place = f"{path}.{field.name}"
        if field.type.kind == "open type":
            converted = _opened(field.type, value, place, value[field.name])
        else:
            converted = to_json(field.type, value[field.name], place)
        (found.setdefault(group, {}) if group else found)[field.name] = converted
    for name in sorted(left):
        _no(f"{path}.{name}", "no edition knows it, and so has no name for it")
    return found


def _sequence(kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
    fields = _fields(kind)
    groups = {group for _, group in fields if group}
    given: dict[str, Any] = {}
    for name, item in value.items():
        given.update(_want(item, dict, f"{path}.{name}") if name in groups else {name: item})
    known = {field.name: field for field, _ in fields}
    for name in given:
        if name not in known:
            _no(f"{path}.{name}", f"is no member; known: {', '.join(known)}")
    # An open type comes after what tells its type.
    later = sorted(given, key=lambda name: known[name].type.kind == "open type")
    found: dict[str, Any] = {}
    for name in later:
        field, place = known[name], f"{path}.{name}"
        if field.type.kind == "open type":
            found[name] = _from_opened(field.type, found, place, given[name])
        else:
            found[name] = from_json(field.type, given[name], place)
    return found


def _fields(kind: Type) -> list[tuple[Field, str]]:
    """Components with the name of their addition group; what is added alone is in none."""
    fields = list(kind.fields)
    additions = [field.addition for field in fields if field.addition]
    grouped = [number for number in dict.fromkeys(additions) if additions.count(number) > 1]
    names = {number: f"ext{at}" for at, number in enumerate(grouped, 1)}
    return [(field, names.get(field.addition, "")) for field in fields]


def _choice(kind: Type, value: tuple[str, Any], path: str) -> dict[str, Any]:
    name, chosen = value
    for field in kind.fields:
        if field.name == name:
            return {name: to_json(field.type, chosen, f"{path}.{name}")}
    return _no(f"{path}.{name}", "no edition knows this alternative, and so has no name for it")


def _alternative(kind: Type, value: dict[str, Any], path: str) -> tuple[str, Any]:
    if len(value) != 1:
        _no(path, f"{len(value)} members; a CHOICE has one of {', '.join(field.name for field in kind.fields)}")
    ((name, chosen),) = value.items()
    for field in kind.fields:
        if field.name == name:
            return name, from_json(field.type, chosen, f"{path}.{name}")
    return _no(f"{path}.{name}", f"is no alternative; known: {', '.join(field.name for field in kind.fields)}")


def _row(kind: Type, siblings: dict[str, Any], path: str) -> Type:
    """The type that the number beside it says: containerId, regionId."""
    numbers = [value for value in siblings.values() if type(value) is int]
    for number, row in kind.rows:
        if numbers[:1] == [number]:
            return row
    return _no(path, f"what {shown(numbers[0]) if numbers else 'no number'} stands for is not known")


def _opened(kind: Type, siblings: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    row = _row(kind, siblings, path)
    if isinstance(value, bytes):
        _no(path, "its content could not be decoded")
    return {row.name or "": to_json(row, value, f"{path}.{row.name}")}


def _from_opened(kind: Type, siblings: dict[str, Any], path: str, value: Any) -> Any:
    row = _row(kind, siblings, path)
    content = _want(value, dict, path)
    if list(content) != [row.name]:
        _no(path, f"has to have one member, {row.name}")
    return from_json(row, content[row.name], f"{path}.{row.name}")


def _integer(kind: Type, value: Any, path: str) -> int:
    if type(value) not in (int, float) or not math.isfinite(value):
        _no(path, f"{shown(value)} is not a number")
    if abs(value) >= LARGEST:
        _no(path, f"{shown(value)} is out of range")
    scale, themselves = UNITS.get(kind.name or "", (1, frozenset()))
    if scale != 1 and value not in themselves:
        number: int = round(value * scale)
        return number
    if value != int(value):
        _no(path, f"{shown(value)} is not an integer")
    return int(value)


def _enumerated(kind: Type, value: Any, path: str) -> str | int:
    number = _integer(kind, value, path)
    for name, known in kind.names:
        if known == number:
            return name
    return _no(path, f"{number} is none of {', '.join(f'{known} {name}' for name, known in kind.names)}")


def _bits(kind: Type, value: tuple[bytes, int], path: str) -> Any:
    octets, size = value
    if kind.names:
        named = {at for _, at in kind.names}
        for at in range(size):
            if _is_set(octets, at) and at not in named:
                _no(path, f"bit {at} has no name")
        return {name: at < size and _is_set(octets, at) for name, at in kind.names}
    digits = octets.hex().upper()
    return digits if kind.low == kind.high else {"value": digits, "length": size}


def _bit_string(kind: Type, value: Any, path: str) -> tuple[bytes, int]:
    if not kind.names:
        return _unnamed_bits(kind, value, path)
    known = dict(kind.names)
    number = highest = 0
    for name, is_set in _want(value, dict, path).items():
        if name not in known:
            _no(f"{path}.{name}", f"is no bit; known: {', '.join(known)}")
        if _want(is_set, bool, f"{path}.{name}"):
            number |= 1 << known[name]
            highest = max(highest, known[name] + 1)
    size = max(kind.low or 0, highest)
    octets = bytearray(-(-size // 8))
    for at in range(size):
        octets[at // 8] |= (number >> at & 1) << (7 - at % 8)
    return bytes(octets), size


def _unnamed_bits(kind: Type, value: Any, path: str) -> tuple[bytes, int]:
    if kind.low == kind.high:
        return _octets(_want(value, str, path), path), kind.low or 0
    table = _want(value, dict, path)
    octets = _octets(_want(table.get("value"), str, f"{path}.value"), f"{path}.value")
    length = _want(table.get("length"), int, f"{path}.length")
    if not 0 <= length <= 8 * len(octets):
        _no(f"{path}.length", f"{shown(length)} bits are not in {len(octets)} octets")
    return octets, length


def _octets(digits: str, path: str) -> bytes:
    try:
        return bytes.fromhex(digits)
    except ValueError:
        return _no(path, f"{shown(digits)} is not hexadecimal digits")


def _is_set(octets: bytes, at: int) -> bool:
    return bool(octets[at // 8] >> (7 - at % 8) & 1)


def _element(kind: Type) -> Type:
    assert kind.element is not None
    return kind.element


def _want(value: Any, kind: type, path: str) -> Any:
    if type(value) is not kind:
        _no(path, f"{shown(value)} is not {KINDS[kind]}")
    return value


def _no(path: str, why: str) -> NoReturn:
    raise ConversionError(path, why)


def names(kind: Type) -> Iterator[str]:
    """The components of a PDU beside its header."""
    return (field.name for field in kind.fields if field.name != "header")
