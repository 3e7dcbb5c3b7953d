"""message_format "json/raw" of Orange's its-client, for CAM: names in snake_case, and the integers of the ASN.1.

The numbers of a CAM of V1.3.2 (protocolVersion 1) are those of its data dictionary, TS 102 894-2 V1.2.1; the schema has
those of V1.3.1 and later. CurvatureValue is converted: 1/30,000 there, 1/10,000 of 1/m in the schema. LanePosition is
refused: V1.3.2 counts from the outermost lane, the schema from the innermost.

Source: schema/cam/cam_schema_2-4-0.json of its-client. Not there, and refused by path: causes of an incident, lanes
that are closed, data of public transport; and every type but CAM.
"""

import re
from typing import Any

from drivers.wire.v2n_payload_json import KINDS, shown
from drivers.wire.v2n_payload_si import ConversionError, element_of
from drivers.wire.v2n_type import Field, Type

KINDS_OF_MESSAGES = ("cam",)

_WORDS = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_NAMES = {"roadworksSubCauseCode": "road_works_sub_cause_code"}
_SEQUENCES = {"semiMajor": ("semi_major", "semi_minor", "semi_major_orientation")}  # by how the first member begins
# CurvatureValue of TS 102 894-2 V1.2.1: -30,000..30,000, and 30,001 for unavailable; three are one of the schema.
_FINE, _FINE_UNAVAILABLE, _FINE_IN_ONE = -30_000, 30_001, 3
_RIGHT_MOST, _LEFT_MOST, _UNAVAILABLE = -1023, 1022, 1023  # of the schema; the first two mean "or more"
_FROM_OUTSIDE = ("outermostDrivingLane", 1)  # LanePosition of V1.2.1

_LEFT_OUT = frozenset({"CauseCode", "CauseCodeV2", "ClosedLanes", "PtActivation"})


def to_raw(tree: Type, value: dict[str, Any]) -> dict[str, Any]:
    """The member `message` of a CAM. Raises ConversionError."""
    version, _, station = (value["header"][field.name] for field in tree.fields[0].type.fields)
    body = tree.fields[1].type
    time, parameters = (value["cam"][field.name] for field in body.fields)
    found = {"protocol_version": version, "station_id": station, "generation_delta_time": time}
    return {**found, **_written(body.fields[1].type, parameters, "message")}


def from_raw(tree: Type, number: int, message: dict[str, Any]) -> dict[str, Any]:
    """The value of a CAM, with a messageID. Raises ConversionError."""
    head, body = tree.fields[0].type, tree.fields[1].type
    rest = dict(message)
    version, station, time = (
        _want(rest.pop(name, None), int, f"message.{name}")
        for name in ("protocol_version", "station_id", "generation_delta_time")
    )
    header = dict(zip((field.name for field in head.fields), (version, number, station), strict=True))
    parameters = _read(body.fields[1].type, rest, "message")
    return {"header": header, "cam": {body.fields[0].name: time, body.fields[1].name: parameters}}


def _members(kind: Type, path: str) -> dict[str, Field]:
    """Components of a SEQUENCE by their names in the schema."""
    if kind.name in _LEFT_OUT:
        raise ConversionError(path, 'is not converted to or from "json/raw"; take "asn1/uper"')
    fields = list(kind.fields)
    names = [_snake(field.name) for field in fields]
    if len(fields) == 2 and "onfidence" in fields[1].name:
        names = ["value", "confidence"]
    for beginning, others in _SEQUENCES.items():
        if fields and fields[0].name.startswith(beginning):
            names = list(others)
    return dict(zip(names, fields, strict=True))


def _written(kind: Type, value: Any, path: str) -> Any:
    match kind.kind:
        case "INTEGER":
            return _coarse(value) if _is_fine(kind, path) else value
        case "BOOLEAN":
            return value
        case "ENUMERATED":
            return dict(kind.names).get(value, value)
        case "SEQUENCE":
            members = _members(kind, path)
            left = set(value) - {field.name for field in members.values()}
            if left:
                raise ConversionError(f"{path}.{min(left)}", "no edition knows it, and so has no name for it")
            return {
                name: _written(field.type, value[field.name], f"{path}.{name}")
                for name, field in members.items()
                if field.name in value
            }
        case "SEQUENCE OF":
            element = element_of(kind)
            return [_written(element, item, f"{path}[{at}]") for at, item in enumerate(value)]
        case "CHOICE":
            name, chosen = value
            for field in kind.fields:
                if field.name == name:
                    return {_snake(name): _written(field.type, chosen, f"{path}.{_snake(name)}")}
        case "BIT STRING" if kind.names:
            octets, size = value
            return {_snake(name): at < size and bool(octets[at // 8] >> (7 - at % 8) & 1) for name, at in kind.names}
    raise ConversionError(path, 'has no form in "json/raw"; take "asn1/uper"')


def _read(kind: Type, value: Any, path: str) -> Any:
    match kind.kind:
        case "INTEGER":
            number = _want(value, int, path)
            return _fine(number, path) if _is_fine(kind, path) else number
        case "BOOLEAN":
            return _want(value, bool, path)
        case "ENUMERATED":
            return _named({number: name for name, number in kind.names}, _want(value, int, path), path)
        case "SEQUENCE":
            members = _members(kind, path)
            found = {}
            for name, item in _want(value, dict, path).items():
                field = _named(members, name, f"{path}.{name}")
                found[field.name] = _read(field.type, item, f"{path}.{name}")
            return found
        case "SEQUENCE OF":
            element = element_of(kind)
            return [_read(element, item, f"{path}[{at}]") for at, item in enumerate(_want(value, list, path))]
        case "CHOICE":
            if len(_want(value, dict, path)) != 1:
                raise ConversionError(path, f"{len(value)} members; there has to be one")
            ((name, item),) = value.items()
            field = _named({_snake(field.name): field for field in kind.fields}, name, f"{path}.{name}")
            return field.name, _read(field.type, item, f"{path}.{name}")
        case "BIT STRING" if kind.names:
            return _bits(kind, _want(value, dict, path), path)
    raise ConversionError(path, 'has no form in "json/raw"; take "asn1/uper"')


def _is_fine(kind: Type, path: str) -> bool:
    """Is it the curvature of V1.2.1? Raises ConversionError for a number of V1.2.1 that is not converted."""
    if _FROM_OUTSIDE in kind.names:
        why = "it counts from the outermost lane, the schema from the innermost"
        raise ConversionError(path, f"LanePosition of CAM V1.3.2 cannot be converted: {why}")
    return kind.name == "CurvatureValue" and kind.low == _FINE


def _coarse(value: int) -> int:
    """The curvature of V1.2.1 in the unit of the schema, to the nearest."""
    if value == _FINE_UNAVAILABLE:
        return _UNAVAILABLE
    return max(_RIGHT_MOST, min(_LEFT_MOST, round(value / _FINE_IN_ONE)))


def _fine(value: int, path: str) -> int:
    if value == _UNAVAILABLE:
        return _FINE_UNAVAILABLE
    if not _RIGHT_MOST <= value <= _LEFT_MOST:
        raise ConversionError(path, f"{value} is not in {_RIGHT_MOST}..{_UNAVAILABLE}")
    return value * _FINE_IN_ONE


def _bits(kind: Type, value: dict[str, Any], path: str) -> tuple[bytes, int]:
    places = {_snake(name): at for name, at in kind.names}
    size = max([kind.low or 0, *(at + 1 for at in places.values())])
    octets = bytearray(-(-size // 8))
    for name, is_set in value.items():
        at = _named(places, name, f"{path}.{name}")
        octets[at // 8] |= _want(is_set, bool, f"{path}.{name}") << (7 - at % 8)
    return bytes(octets), size


def _named(known: dict[Any, Any], name: Any, path: str) -> Any:
    if name not in known:
        raise ConversionError(path, f"is not known; known: {', '.join(map(str, known))}")
    return known[name]


def _want(value: Any, kind: type, path: str) -> Any:
    if type(value) is not kind:
        raise ConversionError(path, f"{shown(value)} is not {KINDS[kind]}")
    return value


def _snake(name: str) -> str:
    return _NAMES.get(name) or _WORDS.sub("_", name).lower()
