"""JSON of Orange's its-client from messages, message_format "json/raw": snake_case names and the integers of the ASN.1.

Structure of the newest schemas: cam 2.4.0, denm 2.3.0, cpm 2.1.1, spatem and mapem 2.0.0. Names that cannot be derived
from the ASN.1 are in names.py; read.py is the inverse.

A CAM of V1.3.2 (protocolVersion 1) has the numbers of its data dictionary, TS 102 894-2 V1.2.1. The schema has those of
V1.3.1 and later. CurvatureValue is converted: its unit is 1/30,000 of 1/m in V1.2.1 and 1/10,000 of 1/m in the schema.
LanePosition is refused: V1.2.1 counts from the outermost lane, the schema from the innermost. Members that a schema
does not name follow the same rule, because the schema allows further members. A value without a form in the schema, or
out of its range, is refused with its path.
"""

from typing import Any

from drivers.wire.type_tree import Type
from drivers.wire.v2n.payload.orange.names import (  # fmt: skip
    CONTAINERS,
    INLINE,
    MASKS,
    MOST,
    NO_FORM,
    NOT_EMPTY,
    SETS,
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
    numbers_of,
    open_type_of,
    size_of,
    snake,
    words_of,
)
from drivers.wire.v2n.payload.si import ConversionError, element_of

# CurvatureValue of TS 102 894-2 V1.2.1: -30,000..30,000, and 30,001 for unavailable. Three units are one unit of the
# schema.
FINE_UNAVAILABLE, FINE_IN_ONE = 30_001, 3
RIGHT_MOST, LEFT_MOST, UNAVAILABLE = -1023, 1022, 1023  # values in the schema; the first two mean "or more"
_CAUSES = 256


def to_raw(kind: str, tree: Type, value: dict[str, Any]) -> dict[str, Any]:
    """Return the member `message`. Raises ConversionError for a value that cannot be converted."""
    version, _, station = (value["header"][field.name] for field in tree.fields[0].type.fields)
    body = tree.fields[1]
    check_edition(kind, body.type)
    written = _Writing(kind).value(body.type, value[body.name], "message")
    return {"protocol_version": version, "station_id": station, **written}


class _Writing:
    """Conversion of values of the message library to JSON.

    kind  name of the message's type, which decides the form of bit strings.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind

    def value(self, kind: Type, value: Any, path: str) -> Any:
        check_form(kind, path)
        match kind.kind:
            case "INTEGER":
                return _coarse(value) if is_fine(kind, path) else _bounded(kind, value, value, path)
            case "BOOLEAN":
                return value
            case "ENUMERATED" if kind.name in WORDS:
                return _word(kind, value, path)
            case "ENUMERATED":
                number = numbers_of(kind).get(value)
                if number is None:
                    raise ConversionError(path, f"{value} is not an item of {kind.name}")
                return _bounded(kind, number, number, path)
            case "SEQUENCE":
                return self._object(kind, value, path)
            case "SEQUENCE OF":
                element = element_of(kind)
                items = [self.value(element, item, f"{path}[{at}]") for at, item in enumerate(value)]
                if kind.name == "Traces":
                    items = [{"path": item} for item in items]
                return _bounded(kind, len(items), items, path)
            case "CHOICE" if kind.name == "RestrictionUserType" and value[0] == "basicType":
                return self.value(kind.fields[0].type, value[1], path)
            case "CHOICE" if kind.name == "NodeOffsetPointXY" and value[0].startswith("node-XY"):
                return {"node_xy": dict(value[1])}
            case "CHOICE" if is_sized(kind):
                return value[1]
            case "CHOICE":
                name, chosen = value
                field = next((one for one in kind.fields if one.name == name), None)
                if field:
                    named = name_of(kind, field)
                    return {named: self.value(field.type, chosen, f"{path}.{named}")}
            case "BIT STRING":
                return self._bits(kind, value, path)
            case "OCTET STRING" if kind.name == "PtActivationData" and value.isascii() and value.decode().isprintable():
                return value.decode()
            case text if text in TEXTS:
                return _bounded(kind, len(value), value, path)
        raise ConversionError(path, NO_FORM)

    def _object(self, kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
        if kind.name in ("CauseCode", "CauseCodeV2"):
            return self._cause(kind, value, path)
        if kind.name == "CpmPayload":
            return self._containers(kind, value, path)
        members = members_of(kind)
        found: dict[str, Any] = {}
        left = len(value)
        for name, field in members.items():
            if field.name in value:
                written = self.value(field.type, value[field.name], path if field.name in INLINE else f"{path}.{name}")
                found |= written if field.name in INLINE else {name: written}
                left -= 1
        if left:
            unknown = set(value) - {field.name for field in members.values()}
            raise ConversionError(f"{path}.{min(unknown)}", "no edition knows it, and so has no name for it")
        return found

    def _cause(self, kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
        first, *_ = kind.fields
        if kind.name == "CauseCode":
            number, detail = (value[field.name] for field in kind.fields)
        else:
            name, detail = value[first.name]
            number = next((at for at, field in enumerate(first.type.fields) if field.name == name), _CAUSES)
        if number >= _CAUSES:
            raise ConversionError(path, f"{number} is not a cause")
        found = {"cause": number, "subcause": detail}
        return {"cc_and_scc": found} if is_wrapped(self._kind) else found

    def _containers(self, kind: Type, value: dict[str, Any], path: str) -> dict[str, Any]:
        management, containers = kind.fields
        found = {
            "management_container": self.value(management.type, value[management.name], f"{path}.management_container")
        }
        rows = dict(open_type_of(containers).rows)
        for item in value[containers.name]:
            number, content = item["containerId"], item["containerData"]
            if number not in rows or isinstance(content, bytes) or CONTAINERS[number] in found:
                raise ConversionError(f"{path}.{containers.name}", f"container {number} {NO_FORM}")
            name = CONTAINERS[number]
            written = self.value(rows[number], content, f"{path}.{name}")
            if name == "originating_rsu_container":
                written = list(written.values())
            if name == "perceived_object_container":
                count, written = written.values()
                if count != len(written):
                    raise ConversionError(f"{path}.{name}", f"count {count}, but the list has {len(written)} objects")
            found[name] = written
        return found

    def _bits(self, kind: Type, value: tuple[bytes, int], path: str) -> Any:
        octets, size = value
        places = [at for at in range(size) if octets[at // 8] >> (7 - at % 8) & 1]
        names = {at: name for name, at in bit_names(kind)}
        unnamed = [at for at in places if at not in names]
        told = size_of(kind, places) if kind.names or self._kind in MASKS else len(names)
        if unnamed or size != told:
            raise ConversionError(
                path, f"bit {unnamed[0]} has no name" if unnamed else f"{size} bits: not a length of the schema"
            )
        if self._kind in SETS:
            if kind.name in NOT_EMPTY and not places:
                raise ConversionError(path, "no bit is set; the schema needs at least one")
            return [_word(kind, names[at], f"{path}[{at}]") for at in places]
        if self._kind in MASKS:
            return sum(1 << at for at in places)
        return {snake(name): at in places for at, name in names.items()}


def _word(kind: Type, name: str, path: str) -> str:
    words = words_of(kind)
    if name not in words:
        raise ConversionError(path, f"{name} is not in the schema")
    return words[name]


def _bounded(kind: Type, size: int, value: Any, path: str) -> Any:
    """Return the value. Raises ConversionError if its number or size is out of range in the ASN.1 or the schema."""
    low, high = kind.low, MOST.get(path.rpartition(".")[2], kind.high)
    if (low is not None and size < low) or (high is not None and size > high):
        raise ConversionError(path, f"{size} is not in {low}..{high} of the schema")
    return value


def _coarse(value: int) -> int:
    """Convert a curvature of V1.2.1 to the unit of the schema, rounded to the nearest."""
    if value == FINE_UNAVAILABLE:
        return UNAVAILABLE
    return max(RIGHT_MOST, min(LEFT_MOST, round(value / FINE_IN_ONE)))
