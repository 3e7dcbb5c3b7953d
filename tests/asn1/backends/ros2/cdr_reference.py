"""Reference for to_cdr: writes a decoded message as CDR with rosbags.

It uses nothing of the C code, its generator or the layout. The value is that of `decode`, the path to a field is that
of the model. Types come from the text of the .msg files.
"""

from collections.abc import Mapping
from typing import Any

import numpy
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from asn1.backends.ros2 import msg
from asn1.backends.ros2.model import Path, Role, RosField, RosMessage, RosPackage
from asn1.model import types as t

ABSENT = object()
EMPTY = "structure_needs_at_least_one_member"  # rosidl gives it to a message without fields


class Reference:
    """One package."""

    def __init__(self, schema: t.Schema, package: RosPackage) -> None:
        self.schema, self.package = schema, package
        self.store = get_typestore(Stores.LATEST)
        types: dict[str, Any] = {}
        for message in package.messages.values():
            types |= get_types_from_msg(msg.text(schema, package, message), self.type_of(message.name))
        self.store.register(types)

    def type_of(self, message: str) -> str:
        return f"{self.package.name}/msg/{message}"

    def cdr(self, edition: str, value: Any) -> bytes:
        """What rosbags writes of a decoded message."""
        top = self.package.top(edition)
        return bytes(self.store.serialize_cdr(self.object(top, top.definition.type, value), self.type_of(top.name)))

    def object(self, message: RosMessage, type_: t.Type, value: Any) -> Any:
        made = self.store.types[self.type_of(message.name)]
        if not message.fields:
            return made(**{EMPTY: 0})
        return made(**{field.name: self.field(field, type_, value) for field in message.fields})

    # ------------------------------------------------------------ a field

    def field(self, field: RosField, type_: t.Type, value: Any) -> Any:
        found, at = self.at(type_, value, field.source)
        if field.role is Role.PRESENT:
            return found is not ABSENT and found != self.default(type_, field.source)
        if field.role is Role.CHOICE:
            numbers = {name: number for number, name in field.options}
            return 0 if found is ABSENT else numbers.get(found[0], unknown(field.type))
        if field.role is Role.BITS_UNUSED:
            return 0 if found is ABSENT else -found[1] % 8
        if field.is_array:
            return self.array(field, at, found)
        return self.one(field, at, found)

    def array(self, field: RosField, type_: t.Type, value: Any) -> Any:
        base = self.base(type_)
        if isinstance(base, t.SequenceOf):
            made = [self.one(field, base.element, one) for one in (() if value is ABSENT else value)]
        else:
            octets = b"" if value is ABSENT else value[0] if isinstance(value, tuple) else value
            made = list(octets)
        is_number = field.type not in self.package.messages and field.type != "string"
        return numpy.array(made, dtype=field.type) if is_number else made

    def one(self, field: RosField, type_: t.Type, value: Any) -> Any:
        if field.type in self.package.messages:
            return self.object(self.package.messages[field.type], type_, value)
        if field.type == "string":
            return "" if value is ABSENT else value
        if field.type == "bool":
            return value is not ABSENT and value
        return 0 if value is ABSENT else self.number(field.type, type_, value)

    def number(self, ros_type: str, type_: t.Type, value: Any) -> int:
        """What an extension lets be larger or smaller than the field becomes the nearest that it holds."""
        base = self.base(type_)
        if isinstance(base, t.Enumerated):
            return next(item.value for item in (*base.root, *base.additions) if item.name == value)
        if isinstance(base, t.BitString):
            octets, count = value
            number = sum((octets[bit // 8] >> 7 - bit % 8 & 1) << bit for bit in range(min(count, 64)))
            return number - (number >> 63 << 64)
        limits = numpy.iinfo(ros_type)
        return min(max(int(value), int(limits.min)), int(limits.max))

    # ------------------------------------------------------------ the way to it

    def at(self, type_: t.Type, value: Any, path: Path) -> tuple[Any, t.Type]:
        """The value at the end of a path, or ABSENT, and its type."""
        holder: Any = None
        for name in path:
            base = self.base(type_)
            match base:
                case t.Sequence():
                    component = next(one for one in _components(base) if one.name == name)
                    holder = value
                    default = ABSENT if component.default is None else component.default
                    value = ABSENT if value is ABSENT else value.get(name, default)
                    type_ = component.type
                case t.Choice():
                    type_ = next(one.type for one in _components(base) if one.name == name)
                    value = value[1] if value is not ABSENT and value[0] == name else ABSENT
                case t.OpenType():
                    rows = self.schema.modules[base.set_.module].sets[base.set_.name].rows
                    type_ = next(row.type for row in rows if str(row.value) == name)
                    is_chosen = isinstance(holder, Mapping) and str(holder.get(base.selector)) == name
                    value = value if is_chosen else ABSENT
                case _:
                    raise TypeError(f"{name} of {type(base).__name__}")
        return value, type_

    def default(self, type_: t.Type, path: Path) -> Any:
        """Of the component that a path ends in; ABSENT where it has none."""
        _, holder = self.at(type_, ABSENT, path[:-1])
        base = self.base(holder)
        if not isinstance(base, t.Sequence):
            return ABSENT
        default = next(one.default for one in _components(base) if one.name == path[-1])
        return ABSENT if default is None else default

    def base(self, type_: t.Type) -> t.Type:
        while isinstance(type_, t.Reference):
            type_ = self.schema.resolve(type_).type
        return type_


def unknown(ros_type: str) -> int:
    """What stands for a choice that the message has no field for."""
    limits = numpy.iinfo(ros_type)
    return -1 if limits.min < 0 else int(limits.max)


def _components(type_: t.Sequence | t.Choice) -> list[t.Component]:
    additions = [
        one for group in type_.additions for one in (group.components if isinstance(group, t.Group) else (group,))
    ]
    tail = type_.tail if isinstance(type_, t.Sequence) else ()
    return [*type_.root, *additions, *tail]
