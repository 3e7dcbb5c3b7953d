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
from asn1.ros2.model import Path, Role, RosConstant, RosField, RosMessage, RosPackage
from asn1.ros2.names import constant_name, field_name, integer_type, type_name
from asn1.selection import components_of, reached, references_of
from asn1.types import (
    BitString,
    Boolean,
    CharacterString,
    Choice,
    ClassField,
    Component,
    Definition,
    Enumerated,
    Inner,
    Integer,
    Message,
    Named,
    Null,
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

    Raises ValueError where a message would hold itself, which no .msg can say.
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
        maker = _Maker(schema, reference, OLDER.get(edition.name, {}))
        messages[name] = maker.message()
        waiting += maker.reached
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
        raise ValueError(f"{message.name}: two types are called so, and they are not the same")


def _subcauses(schema: Schema, edition: Message) -> Iterator[Reference]:
    for key in sorted(reached(schema, {edition.pdu.module})):
        for name in schema.modules[key].definitions:
            if name.endswith("SubCauseCode"):
                yield Reference(module=key, name=name)


class _Maker:
    """The message of one definition, and the definitions that its fields refer to."""

    def __init__(self, schema: Schema, reference: Reference, older: Mapping[tuple[str, str], Older]) -> None:
        self.schema = schema
        self.reference = reference
        self.definition: Definition = schema.resolve(reference)
        self.older = older
        self.reached: list[Reference] = []
        self.left_out: list[Path] = []
        self.unflagged: list[Path] = []

    def message(self) -> RosMessage:
        fields = tuple(_tell_apart(self.top(self.definition.type)))
        module = self.schema.modules[self.reference.module]
        name = message_name(self.reference)
        return RosMessage(name, module, self.definition, fields, tuple(self.left_out), tuple(self.unflagged))

    def top(self, type_: Type) -> list[RosField]:
        match type_:
            case SequenceType():
                return self.sequence(type_, (), "")
            case Choice():
                return self.choice(type_, (), "")
            case SequenceOf():
                return self.leaf(type_, (), "array", "")
            case Null():
                return []
            case _:
                return self.leaf(type_, (), "value", "")

    # ------------------------------------------------------------ what holds components

    def sequence(self, type_: SequenceType, path: Path, prefix: str) -> list[RosField]:
        """The components, those of a type without a name in place of the one that holds them."""
        fields: list[RosField] = []
        in_root = (*type_.root, *type_.tail)
        for component in components_of(type_):
            source = (*path, component.name)
            if _is_regional(component.type):
                self.left_out.append(source)
                continue
            found = self.component(self.renamed(component), source, prefix)
            if component.is_optional and not self.is_inlined(component.type):
                found = _with_flag(found, component, source)
            elif component.is_optional or (component not in in_root and component.default is None):
                self.unflagged.append(source)
            fields += found
        return fields

    def renamed(self, component: Component) -> Component:
        older = self.older.get((self.definition.name, component.name))
        if older is None:
            return component
        type_ = component.type
        if older.type and isinstance(type_, Reference):
            type_ = replace(type_, name=older.type)
        return replace(component, name=older.name, type=type_)

    def choice(self, type_: Choice, path: Path, prefix: str) -> list[RosField]:
        """A number, and every alternative; a prefix where the CHOICE is a component without a name of its type."""
        fields: list[RosField] = []
        options: list[tuple[int, str]] = []
        numbers: list[RosConstant] = []
        for number, component in enumerate(components_of(type_)):
            source = (*path, component.name)
            if _is_regional(component.type):
                self.left_out.append(source)
                continue
            options.append((number, component.name))
            constant = RosConstant("uint8", constant_name(_joined("choice", prefix, component.name)), number)
            found = self.alternative(component, source, prefix)
            if found:
                found[0] = replace(found[0], constants=(*found[0].constants, constant))
            else:
                numbers.append(constant)
            fields += found
        name = f"{field_name(prefix)}_choice" if prefix else "choice"
        number_field = RosField(
            "uint8", name, Role.CHOICE, path, options=tuple(options), constants=tuple(numbers), schema_type=type_
        )
        return [number_field, *fields]

    def alternative(self, component: Component, source: Path, prefix: str) -> list[RosField]:
        """As a component; what stands in a type without a name has that of the alternative in front."""
        if isinstance(component.type, SequenceType):
            return self.sequence(component.type, source, _joined(prefix, component.name))
        return self.component(component, source, prefix)

    def component(self, component: Component, source: Path, prefix: str) -> list[RosField]:
        """One component or alternative; prefix: what stands in front of its name."""
        name = _joined(prefix, component.name)
        match component.type:
            case Null():
                return []
            case SequenceType():
                fields = self.sequence(component.type, source, prefix)
            case Choice():
                fields = self.choice(component.type, source, name)
            case OpenType():
                fields = self.open(component.type, source, name)
            case Reference() if self.is_inlined(component.type):
                fields = self.inline(component.type, source, name)
            case _:
                fields = self.leaf(component.type, source, name, name)
        if fields and fields[0].source == source:
            fields[0] = replace(fields[0], component=component)
        return fields

    def open(self, type_: OpenType, source: Path, name: str) -> list[RosField]:
        """A field for each type that the set names; which of them is there says the component that selects it."""
        fields = []
        for row in self.schema.modules[type_.set_.module].sets[type_.set_.name].rows:
            if not isinstance(row.type, Reference):
                continue
            words = f"{name}-{row.type.name[:1].lower()}{row.type.name[1:]}"
            [field] = self.leaf(row.type, (*source, str(row.value)), words, words)
            constant = RosConstant("uint8", constant_name(f"choice-{words}"), row.value)
            fields.append(replace(field, constants=(constant,)))
        return fields

    def is_inlined(self, type_: Type) -> bool:
        """Whether a type holds the message that it is a component of, but for what its constraint takes away."""
        return bool(_absent(type_)) and self.reference in _held(self.schema, type_)

    def inline(self, type_: Reference, source: Path, name: str) -> list[RosField]:
        """The components of a type in its place, its name in front, without those that may not be there."""
        target = self.schema.resolve(type_).type
        if not isinstance(target, SequenceType):
            raise ValueError(f"{self.definition.name}: {type_.name} holds it and is no SEQUENCE")  # noqa: TRY004 of the schema
        left = tuple(one for one in target.root if one.name not in _absent(type_))
        return self.sequence(replace(target, root=left), source, name)

    # ------------------------------------------------------------ what is a value

    def leaf(self, type_: Type, source: Path, name: str, prefix: str) -> list[RosField]:
        """One field; of a BIT STRING two. prefix: what constants begin with."""
        field = replace(self.plain(type_, prefix), name=field_name(name), source=source, schema_type=type_)
        if not isinstance(type_, BitString):
            return [field]
        unused = RosField("uint8", "bits_unused", Role.BITS_UNUSED, source, constants=field.constants)
        return [replace(field, constants=()), unused]

    def plain(self, type_: Type, prefix: str) -> RosField:
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
                class_ = self.schema.modules[type_.class_.module].classes[type_.class_.name]
                return self.plain(class_.id_type, prefix)
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


# ---------------------------------------------------------------- fields


def _joined(*words: str) -> str:
    return "-".join(word for word in words if word)


def _absent(type_: Type) -> set[str]:
    """Components that WITH COMPONENTS takes away."""
    roots = [constraint.root for constraint in type_.constraints]
    return {
        row.name for root in roots if isinstance(root, Inner) for row in root.components if row.presence == "ABSENT"
    }


def _held(schema: Schema, type_: Type) -> set[Reference]:
    """Every definition that a type holds, at any depth, open types left out."""
    found: set[Reference] = set()
    waiting = [type_]
    while waiting:
        for one in references_of(waiting.pop()):
            plain = replace(one, constraints=())
            if plain not in found and plain.name in schema.modules[plain.module].definitions:
                found.add(plain)
                waiting.append(schema.resolve(plain).type)
    return found


def require_finite(package: RosPackage) -> None:
    """Raises ValueError for a message that holds itself."""
    done: set[str] = set()

    def visit(message: RosMessage, above: tuple[str, ...]) -> None:
        if message.name in above:
            raise ValueError(f"{package.name}: {message.name} holds itself, which no .msg can say")
        if message.name not in done:
            for part in package.parts(message):
                visit(part, (*above, message.name))
            done.add(message.name)

    for message in package.messages.values():
        visit(message, ())


def _is_regional(type_: Type) -> bool:
    if isinstance(type_, SequenceOf):
        return _is_regional(type_.element)
    return isinstance(type_, Reference) and type_.name.startswith("RegionalExtension")


def _with_flag(fields: list[RosField], component: Component, source: Path) -> list[RosField]:
    """Whether it is there, behind the first of its fields."""
    name = fields[0].name if fields else field_name(component.name)
    flag = RosField("bool", f"{name}_is_present", Role.PRESENT, source)
    return [*fields[:1], flag, *fields[1:]]


def _tell_apart(fields: list[RosField]) -> Iterator[RosField]:
    """No two fields, and no two constants, of one name: a second one has the name of what holds it in front."""
    taken: set[str] = set()
    for field in fields:
        name = field.name
        for word in reversed(field.source[:-1] if field.role is not Role.BITS_UNUSED else field.source):
            if name not in taken:
                break
            name = f"{field_name(word)}_{name}"
        if name in taken:
            raise ValueError(f"two fields are called {name}")
        taken.add(name)
        constants = []
        for constant in field.constants:
            if constant.name not in taken:
                taken.add(constant.name)
                constants.append(constant)
        yield replace(field, name=name, constants=tuple(constants))
