"""Messages that a user gives by fields: an example of the edition with these fields, less what the station knows.

The completion then fills in the removed components: stationID, time and position of this station.
"""

import json
from collections.abc import Mapping
from typing import Any

from drivers.message import Fault
from drivers.wire.type_tree import Type
from firmware.codec.library import Message
from firmware.facilities.completing import LATITUDE, LONGITUDE, OWN_POSITION, is_of_station
from firmware.facilities.exchange import MOST_FAULTS
from firmware.facilities.paths import joined

PLACE = (LATITUDE, LONGITUDE)


def from_fields(message: Message, fields: Mapping[str, object]) -> tuple[dict[str, object], list[Fault]]:
    """Return a message in the plain form, and the faults of its fields.

    fields  values by short name (asn1/names.toml) or path; numbers in SI units and degrees, or names of special values.
    """
    paths = {name: message.short_names.get(name, name) for name in fields}
    left, faults = dict(fields), list[Fault]()
    while True:
        try:
            value: dict[str, object] = json.loads(message.to_json(message.encode(message.example(**left)), plain=True))
            break
        except ValueError as error:
            path, reason = getattr(error, "path", ""), getattr(error, "reason", str(error))
            wrong = [name for name in left if path in (name, paths[name])]
            faults += [(paths[name], reason, left.pop(name)) for name in wrong]
            if not wrong:  # the fields do not fit together
                faults.append((path, reason, None))
            if not wrong or len(faults) >= MOST_FAULTS:
                left = {}
    _remove_known(message.type_tree(), value, "", frozenset(paths.values()))
    return value, faults


def _remove_known(kind: Type, value: Any, path: str, given: frozenset[str]) -> None:
    """Remove the components that the station knows, and places that are unknown; those that the user gave stay."""
    if isinstance(value, list) and kind.element is not None:
        for index, one in enumerate(value):
            _remove_known(kind.element, one, f"{path}[{index}]", given)
    if not isinstance(value, dict):
        return
    for field in kind.fields:
        inner = joined(path, field.name)
        if field.name not in value or inner in given:
            continue
        is_place = field.name == OWN_POSITION and not any(one.startswith(f"{inner}.") for one in given)
        if is_of_station(field.type) or is_place or field.name in PLACE:
            del value[field.name]
        else:
            _remove_known(field.type, value[field.name], inner, given)
