"""JSON of Orange's its-client to values of the message library: the inverse of raw.py.

It reads bit strings in the form of every schema. Before, old.py converts the structure of older schemas.
"""

import re
from typing import Any

from drivers.wire.type_tree import Type
from drivers.wire.v2n.payload.json_values import KINDS, shown
from drivers.wire.v2n.payload.orange.names import (  # fmt: skip
    CONTAINERS,
    INLINE,
    NO_FORM,
    TEXTS,
    WORDS,
    bit_names,
    check_edition,
    check_form,
    is_fine,
    is_sized,
    is_wrapped,
    members_of,
    name_of,
    names_of,
    open_type_of,
    size_of,
    snake,
    words_of,
)
from drivers.wire.v2n.payload.orange.raw import FINE_IN_ONE, FINE_UNAVAILABLE, LEFT_MOST, RIGHT_MOST, UNAVAILABLE
from drivers.wire.v2n.payload.si import ConversionError, element_of


def from_raw(kind: str, tree: Type, number: int, message: dict[str, Any]) -> dict[str, Any]:
    """Return the value of a message; number is its messageID.

    Raises ConversionError for an unknown member, and for a member of the wrong type.
    """
    head, body = tree.fields[0].type, tree.fields[1]
    check_edition(kind, body.type)
    rest = dict(message)
    version, station = (
        _want(rest.pop(name, None), int, f"message.{name}") for name in ("protocol_version", "station_id")
    )
    header = dict(zip((field.name for field in head.fields), (version, number, station), strict=True))
    return {"header": header, body.name: _Reading(kind).value(body.type, rest, "message")}


class _Reading:
    """Conversion of JSON to values of the message library, which checks ranges.

    kind  name of the message's type.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind

    def value(self, kind: Type, value: Any, path: str) -> Any:
        check_form(kind, path)
        match kind.kind:
            case "INTEGER":
                number = _want(value, int, path)
                return _fine(number, path) if is_fine(kind, path) else number
            case "BOOLEAN":
                return _want(value, bool, path)
            case "ENUMERATED" if kind.name in WORDS:
                return _named(_own_names(kind), _want(value, str, path), path)
            case "ENUMERATED":
                return _named(names_of(kind), _want(value, int, path), path)
            case "SEQUENCE":
                return self._object(kind, _want(value, dict, path), path)
            case "SEQUENCE OF":
                element = element_of(kind)
                items = _want(value, list, path)
                if kind.name == "Traces":
                    items = [_only(item, "path", f"{path}[{at}]") for at, item in enumerate(items)]
                return [self.value(element, item, f"{path}[{at}]") for at, item in enumerate(items)]
            case "CHOICE" if kind.name == "RestrictionUserType" and isinstance(value, str):
                return kind.fields[0].name, self.value(kind.fields[0].type, value, path)
            case "CHOICE" if kind.name == "NodeOffsetPointXY" and list(_want(value, dict, path)) == ["node_xy"]:
                return self._offset(kind, value["node_xy"], f"{path}.node_xy")
            case "CHOICE" if is_sized(kind):
                small, large = kind.fields
                number = _want(value, int, path)
                return (small if abs(number) <= (small.type.high or 0) else large).name, number
            case "CHOICE":
                if len(_want(value, dict, path)) != 1:
                    raise ConversionError(path, f"{len(value)} members; the object of a CHOICE must have one")
                ((name, item),) = value.items()
                field = _named({name_of(kind, field): field for field in kind.fields}, name.strip(), f"{path}.{name}")
                return field.name, self.value(field.type, item, f"{path}.{name}")
            case "BIT STRING":
                return _bits(kind, value, path)
            case "OCTET STRING" if kind.name == "PtActivationData":
                return _ascii(value, path)
            case text if text in TEXTS:
                return _want(value, str, path)
        raise ConversionError(path, NO_FORM)

    def _object(self, kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
        if kind.name in ("CauseCode", "CauseCodeV2"):
            return self._cause(kind, value, path)
        if kind.name == "CpmPayload":
            return self._containers(kind, value, path)
        members = members_of(kind)
        found: dict[str, Any] = {}
        rest = value
        for field in members.values():
            if field.name in INLINE:
                inner = {key: item for key, item in value.items() if key not in members}
                found[field.name] = self.value(field.type, inner, path)
                rest = {key: item for key, item in value.items() if key in members}
        for name, item in rest.items():
            field = _named(members, name, f"{path}.{name}")
            found[field.name] = self.value(field.type, item, f"{path}.{name}")
        # Mandatory in the ASN.1, but optional in the schema: the default is one zone without points.
        if kind.name == "LocationContainer":
            found.setdefault(members["detection_zones_to_event_position"].name, [[]])
        return found

    def _offset(self, kind: Type, value: Any, path: str) -> tuple[str, dict[str, Any]]:
        """Return the offset in the smallest alternative that can hold it."""
        *others, last = [field for field in kind.fields if field.name.startswith("node-XY")]
        found = self.value(last.type, value, path)
        for field in others:
            low, high = field.type.fields[0].type.low or 0, field.type.fields[0].type.high or 0
            if all(low <= number <= high for number in found.values()):
                return field.name, found
        return last.name, found

    def _cause(self, kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
        if is_wrapped(self._kind):
            path = f"{path}.cc_and_scc"
            value = _want(value.get("cc_and_scc"), dict, path)
        number = _want(value.get("cause"), int, f"{path}.cause")
        detail = _want(value.get("subcause", 0), int, f"{path}.subcause")
        if unknown := set(value) - {"cause", "subcause"}:
            raise ConversionError(f"{path}.{min(unknown)}", "is not known; known: cause, subcause")
        if kind.name == "CauseCode":
            return dict(zip((field.name for field in kind.fields), (number, detail), strict=True))
        first, *_ = kind.fields
        if not 0 <= number < len(first.type.fields):
            raise ConversionError(f"{path}.cause", f"{number} is not a cause")
        return {first.name: (first.type.fields[number].name, detail)}

    def _containers(self, kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
        management, containers = kind.fields
        numbers = {name: number for number, name in CONTAINERS.items()}
        rows = dict(open_type_of(containers).rows)
        found: dict[str, Any] = {containers.name: []}
        for name, item in value.items():
            place = f"{path}.{name}"
            if name == "management_container":
                found[management.name] = self.value(management.type, item, place)
                continue
            number = _named(numbers, name, place)
            content = self._content(rows[number], name, item, place)
            found[containers.name].append({"containerId": number, "containerData": content})
        if management.name not in found:
            raise ConversionError(f"{path}.management_container", "is missing")
        return found

    def _content(self, kind: Type, name: str, item: Any, path: str) -> Any:
        if name == "originating_rsu_container":
            if len(_want(item, list, path)) > 1:
                raise ConversionError(path, f"{len(item)} references; the message has room for one")
            (reference,) = kind.fields
            return {reference.name: self.value(reference.type, item[0], f"{path}[0]")} if item else {}
        if name == "perceived_object_container":
            count, objects = kind.fields
            found = self.value(objects.type, item, path)
            return {count.name: len(found), objects.name: found}
        return self.value(kind, item, path)


def _bits(kind: Type, value: Any, path: str) -> tuple[bytes, int]:
    """Read a bit string of any schema.

    It may be an object of flags, digits 0 and 1, a mask with the first bit as bit 0, or a list of names. Raises
    ConversionError for other values and unknown names.
    """
    names = dict(bit_names(kind))
    if not names:
        raise ConversionError(path, NO_FORM)
    size = None
    match value:
        case dict():
            flags = {snake(name): at for name, at in names.items()}
            set_or_not = {
                _named(flags, name, f"{path}.{name}"): _want(item, bool, f"{path}.{name}")
                for name, item in value.items()
            }
            places = [at for at, is_set in set_or_not.items() if is_set]
            size = None if kind.names else len(value)
        case str():
            if not re.fullmatch("[01]{1,64}", value):
                raise ConversionError(path, f"{shown(value)} is not bits, 0 and 1")
            places, size = [at for at, digit in enumerate(value) if digit == "1"], len(value)
        case list():
            own = _own_names(kind)
            words = [_named(own, _want(item, str, f"{path}[{at}]"), f"{path}[{at}]") for at, item in enumerate(value)]
            places = [names[word] for word in words]
        case _:
            mask = _want(value, int, path)
            if not 0 <= mask < 1 << 64:
                raise ConversionError(path, f"{shown(value)} is not a mask of bits")
            places = [at for at in range(64) if mask >> at & 1]
    size = max(size_of(kind, places), size or 0)
    octets = bytearray(-(-size // 8))
    for at in places:
        octets[at // 8] |= 128 >> at % 8
    return bytes(octets), size


def _own_names(kind: Type) -> dict[str, str]:
    return {word: name for name, word in words_of(kind).items()}


def _ascii(value: Any, path: str) -> bytes:
    text: str = _want(value, str, path)
    if not text.isascii() or not text.isprintable():
        raise ConversionError(path, f"{shown(text)} is not printable ASCII")
    return text.encode()


def _only(value: Any, name: str, path: str) -> Any:
    """Return the only member of an object. Raises ConversionError if it has others."""
    if list(_want(value, dict, path)) != [name]:
        raise ConversionError(path, f"must be an object with the single member {name}")
    return value[name]


def _fine(value: int, path: str) -> int:
    if value == UNAVAILABLE:
        return FINE_UNAVAILABLE
    if not RIGHT_MOST <= value <= LEFT_MOST:
        raise ConversionError(path, f"{value} is not in {RIGHT_MOST}..{UNAVAILABLE}")
    return value * FINE_IN_ONE


def _named(known: dict[Any, Any], name: Any, path: str) -> Any:
    if name not in known:
        raise ConversionError(path, f"is not known; known: {', '.join(map(str, known))}")
    return known[name]


def _want(value: Any, kind: type, path: str) -> Any:
    if type(value) is not kind:
        raise ConversionError(path, f"{shown(value)} is not {KINDS[kind]}")
    return value
