"""Messages that a user gives by fields.

Such a message is an example of the edition with these fields, without what the station knows. The completion then fills
in stationID, time and position of this station.
"""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from drivers.message import Fault
from drivers.wire.type_tree import Type
from firmware.codec.library import Message, breaks_constraint
from firmware.facilities.completing import LATITUDE, LONGITUDE, is_of_station
from firmware.facilities.paths import joined, steps_of


def from_fields(message: Message, fields: Mapping[str, object]) -> tuple[dict[str, object], list[Fault]]:
    """Return a message in the plain form, and the faults of its fields.

    fields  values by short name (asn1/names.toml) or path; numbers in SI units and degrees, or names of special values.
    """
    paths = {name: message.short_names.get(name, name) for name in fields}
    try:
        value, good, faults = _example(message, fields), dict(fields), list[Fault]()
    except ValueError:
        good, faults = _separated(message, fields, paths)
        try:
            value = _example(message, good)
        except ValueError as error:
            faults.append((getattr(error, "path", ""), getattr(error, "reason", str(error)), None))
            value, good = _example(message, {}), {}
    faults += _contradictions(value, good, paths)
    _remove_known(message.type_tree(), value, "", frozenset(map(_spelt, paths.values())))
    return value, faults


def _example(message: Message, fields: Mapping[str, object]) -> dict[str, object]:
    value: dict[str, object] = json.loads(message.to_json(message.encode(message.example(**fields)), plain=True))
    return value


def _separated(
    message: Message, fields: Mapping[str, object], paths: Mapping[str, str]
) -> tuple[dict[str, object], list[Fault]]:
    """Return the fields that can be set, and the faults of the others."""
    good, faults = dict[str, object](), list[Fault]()
    for name, one in fields.items():
        good[name] = one
        try:
            message.example(**good)
        except ValueError as error:
            if not breaks_constraint(error):  # a later field may be needed beside this one
                del good[name]
                faults.append((paths[name], getattr(error, "reason", str(error)), one))
    return good, faults


def _contradictions(
    value: dict[str, object], fields: Mapping[str, object], paths: Mapping[str, str]
) -> Iterator[Fault]:
    """Yield a fault for each field that another one has replaced, by the same path or by another alternative."""
    names: dict[str, str] = {}
    for name, one in fields.items():
        path = paths[name]
        if (first := names.setdefault(_spelt(path), name)) != name:
            yield path, f"given twice: {first} and {name}", one
        elif not _is_in(value, path):
            yield path, "another field excludes it", one


def _is_in(value: object, path: str) -> bool:
    for step in steps_of(path):
        if isinstance(value, list):
            if not (step.isdecimal() and int(step) < len(value)):
                return False
            value = value[int(step)]
        elif isinstance(value, dict):
            known = {_spelt(name): one for name, one in value.items()}
            if step == "*" and len(known) == 1:
                value = next(iter(known.values()))
            elif _spelt(step) in known:
                value = known[_spelt(step)]
            else:
                return False
        else:
            return True  # a string or number that contains more, such as the bits of a BIT STRING
    return True


def _spelt(name: str) -> str:
    """Return a path in one spelling: the message library ignores case, and takes `_` for `-`."""
    return name.lower().replace("-", "_")


def _remove_known(kind: Type, value: Any, path: str, given: frozenset[str]) -> None:
    """Remove the components that the station knows, and places that are unknown; those that the user gave stay."""
    if isinstance(value, list) and kind.element is not None:
        for index, one in enumerate(value):
            _remove_known(kind.element, one, f"{path}[{index}]", given)
    if not isinstance(value, dict):
        return
    for field in kind.fields:
        inner = joined(path, field.name)
        if field.name not in value or _spelt(inner) in given:
            continue
        if is_of_station(field.type) or field.name in (LATITUDE, LONGITUDE):
            del value[field.name]
        else:
            _remove_known(field.type, value[field.name], inner, given)
