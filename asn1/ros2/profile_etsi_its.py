"""Profile etsi_its: messages that are of one type with those of etsi_its_messages (MIT licence), 3.5.0.

Same package, same names, same fields in the same order: then the hashes (RIHS01) are the same, and nodes, bags and
displays that know those messages know ours. Editions that it does not carry have packages of their own, by the same
rules: captain_<message>_<version>_msgs.

What the standard has and these messages have not: regional extensions (`RosMessage.left_out`), NULL, and whether an
extension addition is there that is not OPTIONAL in itself (they have no flag for it).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from asn1.constraints import size_bounds, value_bounds
from asn1.ros2 import RosError
from asn1.ros2.fields import Fields, joined, require_finite
from asn1.ros2.model import Path, Role, RosConstant, RosField, RosMessage, RosPackage
from asn1.ros2.names import constant_name, field_name, integer_type, type_name
from asn1.selection import components_of, reached
from asn1.types import (
    BitString,
    Boolean,
    CharacterString,
    Choice,
    ClassField,
    Component,
    Definition,
    Enumerated,
    Integer,
    Message,
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

NAME = "etsi_its"

# Editions that etsi_its_messages 3.5.0 carries. Its VAM is TS 103 300-3 v2.2.1, of which no modules are given: every
# type of v2.1.1 has the same fields.
PACKAGES = {
    "cam-1.4.1": "etsi_its_cam_msgs",
    "cam-2.1.1": "etsi_its_cam_ts_msgs",
    "cpm-2.1.1": "etsi_its_cpm_ts_msgs",
    "denm-1.3.1": "etsi_its_denm_msgs",
    "denm-2.2.1": "etsi_its_denm_ts_msgs",
    "ivim-2.1.1": "etsi_its_ivim_ts_msgs",
    "mapem-2.1.1": "etsi_its_mapem_ts_msgs",
    "spatem-2.1.1": "etsi_its_spatem_ts_msgs",
    "vam-2.1.1": "etsi_its_vam_ts_msgs",
}

# Two elements have one name, in ITS-Container and in DSRC; etsi_its_messages calls the second so.
OTHER_NAMES = {("r1_dsrc", "SpeedConfidence"): "SpeedConfidenceDSRC"}


class Older(NamedTuple):
    """What a component is called in an older edition, and its type there: of the same range, so of the same octets."""

    name: str
    type: str | None = None


# etsi_its_cpm_ts_msgs is made with TS 102 894-2 v2.1.1, ours with v2.4.1.
OLDER = {
    "cpm-2.1.1": {
        ("EllipticalShape", "orientation"): Older("orientation", "Wgs84AngleValue"),
        ("RectangularShape", "shapeReferencePoint"): Older("centerPoint"),
        ("RectangularShape", "orientation"): Older("orientation", "Wgs84AngleValue"),
        ("RadialShape", "horizontalOpeningAngleStart"): Older(
            "stationaryHorizontalOpeningAngleStart", "Wgs84AngleValue"
        ),
        ("RadialShape", "horizontalOpeningAngleEnd"): Older("stationaryHorizontalOpeningAngleEnd", "Wgs84AngleValue"),
    }
}


def package_name(edition: str) -> str:
    """Of the package that holds an edition's messages: cam-2.3.1 is captain_cam_2_3_1_msgs."""
    words = edition.lower().replace("-", "_").replace(".", "_")
    return PACKAGES.get(edition) or f"captain_{words}_msgs"


def packages(schema: Schema, editions: Sequence[Message]) -> list[RosPackage]:
    """A package for each edition."""
    return [package(schema, edition) for edition in editions]


def package(schema: Schema, edition: Message) -> RosPackage:
    """All messages that the PDU of an edition reaches; of a DENM every subcause as well, though no field is one.

    Raises RosError where a message would hold itself, which no .msg can say.
    """
    waiting = [edition.pdu]
    if edition.type == "denm":
        waiting += _subcauses(schema, edition)
    messages: dict[str, RosMessage] = {}
    while waiting:
        reference = waiting.pop()
        name = message_name(reference)
        if name in messages:
            _require_same(messages[name], schema.resolve(reference))
            continue
        fields = _Fields(schema, reference, OLDER.get(edition.name, {}))
        messages[name] = fields.message()
        waiting += fields.reached
    tops = {edition.name: message_name(edition.pdu)}
    made = RosPackage(package_name(edition.name), NAME, (edition,), tops, dict(sorted(messages.items())))
    require_finite(made)
    return made


def message_name(reference: Reference) -> str:
    """Of the message of a definition."""
    return OTHER_NAMES.get((reference.module, reference.name)) or type_name(reference.name)


def _require_same(message: RosMessage, definition: Definition) -> None:
    """Two elements of one name, in two modules, are one message only where they are the same."""
    if message.definition is not definition and message.definition != definition:
        raise RosError(f"{message.name}: two types are called so, and they are not the same")


def _subcauses(schema: Schema, edition: Message) -> Iterator[Reference]:
    for key in sorted(reached(schema, {edition.pdu.module})):
        for name in schema.modules[key].definitions:
            if name.endswith("SubCauseCode"):
                yield Reference(module=key, name=name)


class _Fields(Fields):
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
