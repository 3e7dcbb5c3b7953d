"""Fields of messages by the rules of etsi_its_messages: names, types, flags and constants."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from asn1.backends.ros2.fields import Fields, joined
from asn1.backends.ros2.model import Path, Role, RosConstant, RosField
from asn1.backends.ros2.names import constant_name, field_name, integer_type, type_name
from asn1.model.constraints import size_bounds, value_bounds
from asn1.model.selection import components_of
from asn1.model.types import (
    BitString,
    Boolean,
    CharacterString,
    Choice,
    ClassField,
    Component,
    Enumerated,
    Integer,
    Named,
    ObjectIdentifier,
    OctetString,
    OpenType,
    Reference,
    Schema,
    SequenceOf,
    Type,
)
from asn1.model.types import Sequence as SequenceType

# Names that replace colliding ones. SpeedConfidence exists in ITS-Container and in DSRC; etsi_its_messages renames the
# second. StationID and StationId differ only by case, so rosidl would give both the same files; no message of
# etsi_its_messages contains both.
OTHER_NAMES = {
    ("r1_dsrc", "SpeedConfidence"): "SpeedConfidenceDSRC",
    ("r2_cdd221", "StationID"): "StationIDCDD221",
}


class Older(NamedTuple):
    """Name and type of a component in an older edition. The type has the same range, so the encoding is the same."""

    name: str
    type: str | None = None


def message_name(reference: Reference) -> str:
    """Return the name of a definition's ROS message."""
    return OTHER_NAMES.get((reference.module, reference.name)) or type_name(reference.name)


class EtsiItsFields(Fields):
    """Fields by the rules of etsi_its_messages."""

    def __init__(self, schema: Schema, reference: Reference, older: Mapping[tuple[str, str], Older]) -> None:
        super().__init__(schema, reference)
        self.older = older
        self.inlined = ""  # name of the component that is being replaced by its own components

    def name_of(self, reference: Reference) -> str:
        return message_name(reference)

    def value_name(self) -> str:
        return "value"

    def list_name(self) -> str:
        return "array"

    def component(self, component: Component, source: Path, prefix: str) -> list[RosField]:
        older = self.older.get((self.definition.name, component.name))
        if older is not None:
            type_ = component.type
            if older.type and isinstance(type_, Reference):
                type_ = replace(type_, name=older.type)
            component = replace(component, name=older.name, type=type_)
        fields = super().component(component, source, prefix)
        if fields and component.default is not None:
            number = _default(self.schema, component)
            if number is not None:
                ros_type = integer_type(min(number, 0), number)
                constant = RosConstant(ros_type, f"{constant_name(fields[0].name)}_DEFAULT", number)
                fields[0] = replace(fields[0], constants=(constant, *fields[0].constants))
        return fields

    def flagged(self, fields: list[RosField], component: Component, source: Path, is_addition: bool) -> list[RosField]:
        """Add a presence flag after the first field of an optional component.

        Components with a DEFAULT, inlined ones, and additions that are not OPTIONAL in themselves get none.
        """
        if component.is_optional and not self.is_inlined(component.type):
            name = fields[0].name if fields else field_name(component.name)
            flag = RosField("bool", f"{name}_is_present", Role.PRESENT, source)
            return [*fields[:1], flag, *fields[1:]]
        if component.is_optional or (is_addition and component.default is None):
            self.unflagged.append(source)
        return fields

    def choice(self, type_: Choice, path: Path, prefix: str) -> list[RosField]:
        """Return the field `choice` and the alternatives.

        Inside a type, it is `<name>_choice`, and alternatives have this prefix.
        """
        fields: list[RosField] = []
        options: list[tuple[int, str]] = []
        numbers: list[RosConstant] = []  # constants of alternatives without a field
        indices = {one.name: index for index, one in enumerate(components_of(type_))}
        for component, source in self.parts(type_, path):
            index = indices[component.name]
            options.append((index, component.name))
            constant = RosConstant("uint8", self.choice_name(prefix, component.name), index)
            found = self.alternative(component, source, prefix)
            if found:
                found[0] = replace(found[0], constants=(*found[0].constants, constant))
            else:
                numbers.append(constant)
            fields += found
        name = f"{field_name(prefix)}_choice" if prefix else "choice"
        number = RosField("uint8", name, Role.CHOICE, path, options=tuple(options), constants=tuple(numbers))
        return [number, *fields]

    def choice_name(self, prefix: str, alternative: str) -> str:
        """Return the name of an alternative's constant: CHOICE_, the CHOICE's name, the alternative's name.

        In an inlined component, its name comes first.
        """
        inside = prefix.removeprefix(self.inlined).lstrip("-")
        return constant_name(joined(self.inlined, "choice", inside, alternative))

    def inline(self, type_: Reference, source: Path, name: str) -> list[RosField]:
        self.inlined = name
        fields = super().inline(type_, source, name)
        self.inlined = ""
        return fields

    def alternative(self, component: Component, source: Path, prefix: str) -> list[RosField]:
        """Return the fields of an alternative. Those of an unnamed SEQUENCE have the alternative's name as prefix."""
        if isinstance(component.type, SequenceType):
            return self.sequence(component.type, source, joined(prefix, component.name))
        return self.component(component, source, prefix)

    def open(self, type_: OpenType, source: Path, name: str) -> list[RosField]:
        """Return a field for each named type of the set. The selecting component says which one is present."""
        fields = []
        for number, row in self.rows(type_):
            words = f"{name}-{row.name[:1].lower()}{row.name[1:]}"
            [field] = self.leaf(row, (*source, str(number)), words)
            constant = RosConstant("uint8", constant_name(f"choice-{words}"), number)
            fields.append(replace(field, constants=(constant,)))
        return fields

    def leaf(self, type_: Type, source: Path, name: str) -> list[RosField]:
        """Return one field; for a BIT STRING two: octets and number of unused bits."""
        plain = self.plain(type_, name if source else "")
        field = replace(plain, name=field_name(name), source=source, schema_type=type_)
        if not isinstance(type_, BitString):
            return [field]
        unused = RosField("uint8", "bits_unused", Role.BITS_UNUSED, source, constants=field.constants)
        return [replace(field, constants=()), unused]

    def plain(self, type_: Type, prefix: str) -> RosField:
        """Return type and constants of a field. prefix: prefix of the constants.

        Raises TypeError for a type without a field.
        """
        match type_:
            case Boolean():
                return RosField("bool", "")
            case Integer():
                bounds = value_bounds(type_.constraints)
                ros_type = integer_type(bounds.low, bounds.high)
                limits = [("MIN", bounds.low), ("MAX", bounds.high)]
                constants = [*_limits(limits, prefix, ros_type), *_named(type_.names, prefix, ros_type)]
                return RosField(ros_type, "", constants=tuple(constants))
            case Enumerated():
                items = (*type_.root, *type_.additions)
                ros_type = integer_type(min(item.value for item in items), max(item.value for item in items))
                return RosField(ros_type, "", constants=tuple(_named(items, prefix, ros_type)))
            case BitString():
                bits = [replace(one, name=f"BIT_INDEX_{one.name}") for one in _named(type_.names, "", "uint8")]
                return RosField("uint8", "", is_array=True, constants=(*_sizes(type_, prefix, "_BITS"), *bits))
            case OctetString():
                return RosField("uint8", "", is_array=True, constants=_sizes(type_, prefix))
            case ObjectIdentifier():
                return RosField("string", "")
            case CharacterString():
                return RosField("string", "", constants=_sizes(type_, prefix))
            case SequenceOf():
                element = self.plain(type_.element, prefix)
                return RosField(element.type, "", is_array=True, constants=_sizes(type_, prefix))
            case ClassField():
                return self.plain(self.identifier_type(type_), prefix)
            case Reference():
                self.reached.append(type_)
                return RosField(message_name(type_), "")
            case _:
                raise TypeError(f"{self.definition.name}: no field for {type(type_).__name__}")


# ---------------------------------------------------------------- constants


def _limits(limits: list[tuple[str, int | None]], prefix: str, ros_type: str) -> Iterator[RosConstant]:
    for name, value in limits:
        if value is not None:
            yield RosConstant(ros_type, constant_name(name, prefix), value)


def _sizes(type_: Type, prefix: str, behind: str = "") -> tuple[RosConstant, ...]:
    """Return constants of the root's size: SIZE, or MIN_SIZE and MAX_SIZE; none if any size is allowed."""
    bounds = size_bounds(type_.constraints)
    if bounds.high is None:
        limits = [("MIN_SIZE", bounds.low or None)]
    elif bounds.low == bounds.high:
        limits = [("SIZE", bounds.high)]
    else:
        limits = [("MIN_SIZE", bounds.low), ("MAX_SIZE", bounds.high)]
    ros_type = integer_type(0, max(value or 0 for _, value in limits))
    return tuple(_limits([(name + behind, value) for name, value in limits], prefix, ros_type))


def _named(names: Sequence[Named], prefix: str, ros_type: str) -> Iterator[RosConstant]:
    for item in names:
        yield RosConstant(ros_type, constant_name(item.name, prefix), item.value)


def _default(schema: Schema, component: Component) -> int | None:
    """Return a DEFAULT as the number in the field; None for a DEFAULT of another kind."""
    if isinstance(component.default, int):
        return int(component.default)
    type_ = component.type
    while isinstance(type_, Reference):
        type_ = schema.resolve(type_).type
    names = type_.names if isinstance(type_, Integer) else ()
    if isinstance(type_, Enumerated):
        names = (*type_.root, *type_.additions)
    return next((one.value for one in names if one.name == component.default), None)
