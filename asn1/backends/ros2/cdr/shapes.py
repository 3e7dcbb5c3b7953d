"""Sizes of ROS messages in octets, as far as they are fixed.

XCDR1 aligns a number to a multiple of its size. So the size of a message depends on its offset modulo 8.
"""

from dataclasses import dataclass, field

from asn1.backends.ros2.model import Role, RosField, RosMessage, RosPackage

SIZES = {
    "bool": 1, "uint8": 1, "int8": 1, "uint16": 2, "int16": 2, "uint32": 4, "int32": 4, "uint64": 8, "int64": 8,
}  # fmt: skip
VARIES = 0xFFFF  # CAPTAIN_CDR_VARIES
# rosidl gives a message without fields one octet, because C and C++ have no empty structs.
EMPTY = RosField("uint8", "structure_needs_at_least_one_member", Role.HEADER)


def fields_of(message: RosMessage) -> tuple[RosField, ...]:
    """Return the serialised fields; a message without fields has one octet."""
    return message.fields or (EMPTY,)


@dataclass
class Shapes:
    """Sizes of the messages of one package."""

    package: RosPackage
    known: dict[tuple[str, bool, int], int | None] = field(default_factory=dict)

    def fields(self, name: str) -> tuple[RosField, ...]:
        """Return the fields of a message."""
        return fields_of(self.package.messages[name])

    def spans(self, name: str, is_empty: bool = False) -> list[int]:
        """Return the octets of a message for each offset modulo 8; VARIES if they depend on lengths.

        is_empty  count every list as empty. A string still varies, because its encoding is never all zeros.
        """
        return [self._capped(self._span(name, is_empty, start)) for start in range(8)]

    def sole(self, field: RosField) -> RosField:
        """Return the innermost field of nested messages with a single field each; any other field itself."""
        while not field.is_array and field.type not in SIZES and field.type != "string":
            inside = self.fields(field.type)
            if len(inside) != 1:
                return field
            field = inside[0]
        return field

    def is_message(self, field: RosField) -> bool:
        """Return whether a field's type is a message, not a number or a string."""
        return field.type not in SIZES and field.type != "string"

    def least(self, field: RosField) -> int:
        """Return the fewest octets of a field's type as a list element: at least 1, without padding."""
        if field.type in SIZES:
            return SIZES[field.type]
        if field.type == "string":
            return 4
        return sum(4 if one.is_array else self.least(one) for one in self.fields(field.type))

    def _capped(self, span: int | None) -> int:
        return VARIES if span is None or span >= VARIES else span

    def _span(self, name: str, is_empty: bool, start: int) -> int | None:
        key = (name, is_empty, start)
        if key not in self.known:
            self.known[key] = None  # result for a message that contains itself through a list
            self.known[key] = self._sum(name, is_empty, start)
        return self.known[key]

    def _sum(self, name: str, is_empty: bool, start: int) -> int | None:
        at = start
        for one in self.fields(name):
            if one.is_array:
                if not is_empty:
                    return None
                at = _up(at, 4) + 4
            elif one.type in SIZES:
                at = _up(at, SIZES[one.type]) + SIZES[one.type]
            elif one.type == "string":
                return None
            else:
                inside = self._span(one.type, is_empty, at % 8)
                if inside is None:
                    return None
                at += inside
        return at - start


def _up(at: int, size: int) -> int:
    return (at + size - 1) // size * size
