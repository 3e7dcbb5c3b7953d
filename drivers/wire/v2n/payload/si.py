"""JSON in SI units, the form of Vanetza-NAP, from values of the message library.

SEQUENCE       an object; extension addition groups are objects `ext1`, `ext2` in it
SEQUENCE OF    an array
CHOICE         an object with one member
ENUMERATED     the number
BIT STRING     an object of booleans if bits have names; else hexadecimal digits, with a length if the size varies;
               {} for a fixed size without names and without a set bit: countryCode
OCTET STRING   hexadecimal digits
open type      its value, without the name of its type; containerId or regionId identifies the type
INTEGER        a number, in SI units for the types of units.py

Source: the examples and vanetza/asn1/rj of nap-it/vanetza-nap.
"""

from typing import Any, NoReturn

from drivers.wire.type_tree import Field, Type
from drivers.wire.v2n.payload.json_values import shown
from drivers.wire.v2n.payload.units import UNITS


class ConversionError(ValueError):
    """Error for a value that cannot be converted.

    after  number of values that were converted before.
    """

    def __init__(self, path: str, why: str, after: int = 0) -> None:
        super().__init__(f"{path}: {why}")
        self.path = path
        self.after = after


def to_json(kind: Type, value: Any, path: str) -> Any:
    """Return the JSON of a value of the message library. Raises ConversionError for a value without counterpart."""
    match kind.kind:
        case "INTEGER":
            scale, themselves = UNITS.get(kind.name or "", (1, ()))
            return value if scale == 1 or value in themselves else value / scale
        case "ENUMERATED":
            return dict(kind.names).get(value, value)
        case "SEQUENCE":
            return _object(kind, value, path)
        case "SEQUENCE OF":
            element = element_of(kind)
            return [to_json(element, item, f"{path}[{at}]") for at, item in enumerate(value)]
        case "CHOICE":
            return _choice(kind, value, path)
        case "BIT STRING":
            return _bits(kind, value, path)
        case "OCTET STRING":
            return value.hex().upper()
    return value  # BOOLEAN, NULL and character strings are unchanged


def _object(kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    left = set(value)
    for field, group in grouped_fields(kind):
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


def grouped_fields(kind: Type) -> list[tuple[Field, str]]:
    """Return the components with the names of their extension addition groups; empty names for other components."""
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


def row_of(kind: Type, siblings: dict[str, Any], path: str) -> Type:
    """Return the type of an open type, from the number beside it: containerId or regionId.

    Raises ConversionError for an unknown number.
    """
    numbers = [value for value in siblings.values() if type(value) is int]
    for number, row in kind.rows:
        if numbers[:1] == [number]:
            return row
    return _no(path, f"unknown meaning of {shown(numbers[0]) if numbers else 'no number'}")


def _opened(kind: Type, siblings: dict[str, Any], path: str, value: Any) -> Any:
    row = row_of(kind, siblings, path)
    if isinstance(value, bytes):
        _no(path, "its content could not be decoded")
    return to_json(row, value, path)


def _bits(kind: Type, value: tuple[bytes, int], path: str) -> Any:
    octets, size = value
    if kind.names:
        named = {at for _, at in kind.names}
        for at in range(size):
            if _is_set(octets, at) and at not in named:
                _no(path, f"bit {at} has no name")
        return {name: at < size and _is_set(octets, at) for name, at in kind.names}
    digits = octets.hex().upper()
    if kind.low != kind.high:
        return {"value": digits, "length": size}
    return digits if any(octets) else {}


def _is_set(octets: bytes, at: int) -> bool:
    return bool(octets[at // 8] >> (7 - at % 8) & 1)


def element_of(kind: Type) -> Type:
    assert kind.element is not None
    return kind.element


def _no(path: str, why: str) -> NoReturn:
    raise ConversionError(path, why)
