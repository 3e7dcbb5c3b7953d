"""Hash RIHS01 of a ROS 2 type, which nodes compare before they exchange messages.

It is a SHA-256 of the type's description. It covers names and types of fields, including those of nested messages, but
not constants, defaults and comments. Source: REP-2016; numbers of types: type_description_interfaces/msg/FieldType.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence

from asn1.backends.ros2.model import RosField, RosPackage

NESTED = 1
NUMBERS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9,
    "float32": 10, "float64": 11, "bool": 15, "byte": 16, "string": 17,
}  # fmt: skip
UNBOUNDED_SEQUENCE = 144  # added to the number of the element's type

# Messages of other packages that our fields contain. They are the same in every ROS 2.
FOREIGN: dict[str, Sequence[RosField]] = {
    "std_msgs/msg/Header": (RosField("builtin_interfaces/Time", "stamp"), RosField("string", "frame_id")),
    "builtin_interfaces/msg/Time": (RosField("int32", "sec"), RosField("uint32", "nanosec")),
}

# Field that rosidl adds to an empty message, in the encoding and in the hash.
EMPTY = (RosField("uint8", "structure_needs_at_least_one_member"),)


def hash_of(package: RosPackage, name: str) -> str:
    """Return the hash of a message: RIHS01_ and 64 hexadecimal digits. Raises KeyError for an unknown message."""
    types = {f"{package.name}/msg/{one.name}": one.fields for one in package.messages.values()} | FOREIGN
    own = f"{package.name}/msg/{name}"
    reached = _reached(package.name, types, own)
    described = {one: _struct(package.name, one, types[one]) for one in sorted(reached)}
    document = {"type_description": described.pop(own), "referenced_type_descriptions": list(described.values())}
    return f"RIHS01_{hashlib.sha256(json.dumps(document).encode()).hexdigest()}"


def _reached(package: str, types: Mapping[str, Sequence[RosField]], own: str) -> set[str]:
    found: set[str] = set()
    waiting = [own]
    while waiting:
        name = waiting.pop()
        found.add(name)
        nested = {_nested(package, field.type) for field in types[name]}
        waiting += nested - found - {""}
    return found


def _struct(package: str, name: str, fields: Sequence[RosField]) -> dict[str, object]:
    return {"type_name": name, "fields": [_field(package, field) for field in fields or EMPTY]}


def _field(package: str, field: RosField) -> dict[str, object]:
    number = NUMBERS.get(field.type, NESTED) + (UNBOUNDED_SEQUENCE if field.is_array else 0)
    nested = _nested(package, field.type)
    return {
        "name": field.name,
        "type": {"type_id": number, "capacity": 0, "string_capacity": 0, "nested_type_name": nested},
    }


def _nested(package: str, type_: str) -> str:
    """Return the full name of a message type; "" for a builtin type."""
    if type_ in NUMBERS:
        return ""
    folder, _, name = type_.rpartition("/")
    return f"{folder or package}/msg/{name}"
