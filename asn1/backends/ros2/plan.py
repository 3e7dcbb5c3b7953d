"""Plan of ROS 2 messages: data for programs that write few of them.

It replaces C code per message. It is one JSON document of the profile etsi_its, compressed by zlib; the Python module
returns it by `ros2_plan()`. The station's recorder makes definitions and CDR of it (firmware/recorder/ros2.py). It has
86 kB for all messages; compiled code has 2 MB.

    types   [name, [field, ...]]: a message; equal messages of several packages appear once
    tops    name of an edition: [package, number of its type, hash (RIHS01)]

    field   [type, name, role, source, numbers, constants]
    type    "uint16", "uint8[]", 17 (a message), [17] (a list of it)
    role    "v" value, "p" presence, "c" choice, "b" unused bits, as model.Role
    source  steps from a decoded value: "name" of a component or alternative; ["name", default]; for an open type
            ["name", row, "selector"], whose row is chosen by the component `selector` of the same SEQUENCE
    numbers numbers of a choice's alternatives or an enumeration's items, by ASN.1 name; null for others
    constants  lines of the .msg
"""

import json
import zlib
from collections.abc import Sequence

from asn1.backends.ros2 import profiles
from asn1.backends.ros2.model import Role, RosError, RosField, RosMessage, RosPackage
from asn1.backends.ros2.rihs import hash_of
from asn1.model.selection import components_of
from asn1.model.types import Choice, Component, Enumerated, Message, OpenType, Reference, Schema, Type
from asn1.model.types import Sequence as SequenceType

ROLES = {Role.VALUE: "v", Role.PRESENT: "p", Role.CHOICE: "c", Role.BITS_UNUSED: "b"}


def source(schema: Schema, editions: Sequence[Message]) -> str:
    """Return C source with the document as data. Editions that ROS 2 cannot represent are omitted."""
    packed = octets(schema, [package for edition in editions for package in _packages(schema, edition)])
    lines = [",".join(map(str, packed[at : at + 32])) for at in range(0, len(packed), 32)]
    return "\n".join(
        [
            "/* Messages of ROS 2 as data, packed by zlib: made by captain-asn1. */",
            "#include <stddef.h>",
            "",
            "extern const unsigned char captain_ros2_plan[];",
            "extern const size_t captain_ros2_plan_octets;",
            "const unsigned char captain_ros2_plan[] = {",
            *(f"    {line}," for line in lines),
            "};",
            "const size_t captain_ros2_plan_octets = sizeof captain_ros2_plan;",
            "",
        ]
    )


def octets(schema: Schema, packages: Sequence[RosPackage]) -> bytes:
    """Return the compressed document. The same schema gives the same octets."""
    plan = _Plan(schema)
    tops = {
        edition: [package.name, plan.of(package, package.messages[top]), hash_of(package, top)]
        for package in packages
        for edition, top in package.tops.items()
    }
    return zlib.compress(json.dumps({"types": plan.types, "tops": tops}, separators=(",", ":")).encode(), 9)


def _packages(schema: Schema, edition: Message) -> list[RosPackage]:
    try:
        return profiles.packages(schema, [edition])
    except RosError:
        return []


class _Plan:
    def __init__(self, schema: Schema) -> None:
        self.schema = schema
        self.types: list[list[object]] = []
        self._known: dict[str, int] = {}

    def of(self, package: RosPackage, message: RosMessage) -> int:
        """Return the number of a message's type. Equal types have one number."""
        fields = [self._field(package, message, field) for field in message.fields]
        key = json.dumps([message.name, fields])
        if key not in self._known:
            self._known[key] = len(self.types)
            self.types.append([message.name, fields])
        return self._known[key]

    def _field(self, package: RosPackage, message: RosMessage, field: RosField) -> list[object]:
        type_: object = f"{field.type}[]" if field.is_array else field.type
        if field.type in package.messages:
            number = self.of(package, package.messages[field.type])
            type_ = [number] if field.is_array else number
        constants = [f"{one.type} {one.name}={one.value}" for one in field.constants]
        source = self._source(message.definition.type, field.source)
        return [type_, field.name, ROLES[field.role], source, self._numbers(field), "\n".join(constants)]

    def _numbers(self, field: RosField) -> dict[str, int] | None:
        if field.role is Role.CHOICE:
            return {name: number for number, name in field.options}
        base = self._base(field.schema_type) if field.schema_type is not None else None
        return (
            {item.name: item.value for item in (*base.root, *base.additions)} if isinstance(base, Enumerated) else None
        )

    def _source(self, type_: Type, path: Sequence[str]) -> list[object]:
        steps: list[object] = []
        for name in path:
            base = self._base(type_)
            if isinstance(base, OpenType):
                rows = self.schema.modules[base.set_.module].sets[base.set_.name].rows
                type_ = next(row.type for row in rows if str(row.value) == name)
                steps[-1] = [steps[-1], int(name), base.selector]
                continue
            component = self._component(base, name)
            steps.append(name if component.default is None else [name, component.default])
            type_ = component.type
        return steps

    def _component(self, type_: Type, name: str) -> Component:
        if not isinstance(type_, SequenceType | Choice):
            raise TypeError(f"{name} of {type(type_).__name__}")
        return next(one for one in components_of(type_) if one.name == name)

    def _base(self, type_: Type) -> Type:
        while isinstance(type_, Reference):
            type_ = self.schema.resolve(type_).type
        return type_
