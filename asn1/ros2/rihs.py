"""The hash that two ROS 2 nodes compare before they talk: RIHS01, SHA-256 over the description of a type.

Source: REP-2016; numbers of types: type_description_interfaces/msg/FieldType. Names and types of fields are in it,
those of all parts as well; constants, defaults and comments are not.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence

from asn1.ros2.model import RosField, RosPackage

NESTED = 1
NUMBERS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9,
    "float32": 10, "float64": 11, "bool": 15, "byte": 16, "string": 17,
}  # fmt: skip
UNBOUNDED_SEQUENCE = 144  # above the number of its element

# Messages of other packages that fields of ours are of: std_msgs and builtin_interfaces of every ROS 2.
FOREIGN: dict[str, Sequence[RosField]] = {
    "std_msgs/msg/Header": (RosField("builtin_interfaces/Time", "stamp"), RosField("string", "frame_id")),
    "builtin_interfaces/msg/Time": (RosField("int32", "sec"), RosField("uint32", "nanosec")),
}

# What an empty message has on the wire and in its hash.
EMPTY = (RosField("uint8", "structure_needs_at_least_one_member"),)


def hash_of(package: RosPackage, name: str) -> str:
    """RIHS01_ and 64 hexadecimal digits, of a message of a package. Raises KeyError where there is none."""
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
    """The full name of a message, nothing for a type of the language."""
    if type_ in NUMBERS:
        return ""
    folder, _, name = type_.rpartition("/")
    return f"{folder or package}/msg/{name}"
