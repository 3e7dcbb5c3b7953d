"""The fields of messages as etsi_its_messages has them: their names, types and flags, and their constants."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from asn1.constraints import size_bounds, value_bounds
from asn1.ros2.fields import Fields, joined
from asn1.ros2.model import Path, Role, RosConstant, RosField
from asn1.ros2.names import constant_name, field_name, integer_type, type_name
from asn1.selection import components_of
from asn1.types import (
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
from asn1.types import Sequence as SequenceType

# Two elements have one name, in ITS-Container and in DSRC; etsi_its_messages calls the second so. Another two have one
# but for a capital, of which rosidl would make the same files; no message of etsi_its_messages holds both.
OTHER_NAMES = {
    ("r1_dsrc", "SpeedConfidence"): "SpeedConfidenceDSRC",
    ("r2_cdd221", "StationID"): "StationIDCDD221",
}


class Older(NamedTuple):
    """What a component is called in an older edition, and its type there: of the same range, so of the same octets."""

    name: str
    type: str | None = None


def message_name(reference: Reference) -> str:
    """Of the message of a definition."""
    return OTHER_NAMES.get((reference.module, reference.name)) or type_name(reference.name)


class EtsiItsFields(Fields):
    """By the rules of etsi_its_messages."""

    def __init__(self, schema: Schema, reference: Reference, older: Mapping[tuple[str, str], Older]) -> None:
        super().__init__(schema, reference)
        self.older = older
        self.inlined = ""  # the component whose own components stand in its place

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
        """Behind the first of its fields. None for a DEFAULT, none for what is inlined or mandatory in an addition."""
        if component.is_optional and not self.is_inlined(component.type):
            name = fields[0].name if fields else field_name(component.name)
            flag = RosField("bool", f"{name}_is_present", Role.PRESENT, source)
            return [*fields[:1], flag, *fields[1:]]
        if component.is_optional or (is_addition and component.default is None):
            self.unflagged.append(source)
        return fields

    def choice(self, type_: Choice, path: Path, prefix: str) -> list[RosField]:
        """`choice`, or `<name>_choice` with the name before every alternative."""
        fields: list[RosField] = []
        options: list[tuple[int, str]] = []
        numbers: list[RosConstant] = []  # of alternatives without a field
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
        """CHOICE_, the name of the CHOICE, that of the alternative; behind the name of a component that is inlined."""
        inside = prefix.removeprefix(self.inlined).lstrip("-")
        return constant_name(joined(self.inlined, "choice", inside, alternative))

    def inline(self, type_: Reference, source: Path, name: str) -> list[RosField]:
        self.inlined = name
        fields = super().inline(type_, source, name)
        self.inlined = ""
        return fields

    def alternative(self, component: Component, source: Path, prefix: str) -> list[RosField]:
        """As a component; what stands in a type without a name has that of the alternative in front."""
        if isinstance(component.type, SequenceType):
            return self.sequence(component.type, source, joined(prefix, component.name))
        return self.component(component, source, prefix)

    def open(self, type_: OpenType, source: Path, name: str) -> list[RosField]:
        """A field for each type that the set names; which of them is there says the component that selects it."""
        fields = []
        for number, row in self.rows(type_):
            words = f"{name}-{row.name[:1].lower()}{row.name[1:]}"
            [field] = self.leaf(row, (*source, str(number)), words)
            constant = RosConstant("uint8", constant_name(f"choice-{words}"), number)
            fields.append(replace(field, constants=(constant,)))
        return fields

    def leaf(self, type_: Type, source: Path, name: str) -> list[RosField]:
        """One field; of a BIT STRING two."""
        plain = self.plain(type_, name if source else "")
        field = replace(plain, name=field_name(name), source=source, schema_type=type_)
        if not isinstance(type_, BitString):
            return [field]
        unused = RosField("uint8", "bits_unused", Role.BITS_UNUSED, source, constants=field.constants)
        return [replace(field, constants=()), unused]

    def plain(self, type_: Type, prefix: str) -> RosField:
        """Type and constants; prefix: what constants begin with."""
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
    """SIZE, or MIN_SIZE and MAX_SIZE, of the root; nothing where any size is allowed."""
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
    """A DEFAULT as the number that a field has; None where it is no number."""
    if isinstance(component.default, int):
        return int(component.default)
    type_ = component.type
    while isinstance(type_, Reference):
        type_ = schema.resolve(type_).type
    names = type_.names if isinstance(type_, Integer) else ()
    if isinstance(type_, Enumerated):
        names = (*type_.root, *type_.additions)
    return next((one.value for one in names if one.name == component.default), None)
