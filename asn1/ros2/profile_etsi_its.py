"""Profile etsi_its: messages that are of one type with those of etsi_its_messages (MIT licence), 3.5.0.

Same package, same names, same fields in the same order: then the hashes (RIHS01) are the same, and nodes, bags and
displays that know those messages know ours. Editions that it does not carry have packages of their own, by the same
rules: captain_<message>_<version>_msgs.

What the standard has and these messages have not: regional extensions (`RosMessage.left_out`), NULL, and whether an
extension addition is there that is not OPTIONAL in itself (they have no flag for it).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from asn1.constraints import size_bounds, value_bounds
from asn1.ros2.model import Path, Role, RosConstant, RosField, RosMessage, RosPackage
from asn1.ros2.names import constant_name, field_name, integer_type, type_name
from asn1.selection import components_of
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

# Editions that etsi_its_messages 3.5.0 carries. Its VAM is TS 103 300-3 v2.2.1, of which no modules are given.
PACKAGES = {
    "cam-1.4.1": "etsi_its_cam_msgs",
    "cam-2.1.1": "etsi_its_cam_ts_msgs",
    "cpm-2.1.1": "etsi_its_cpm_ts_msgs",
    "denm-1.3.1": "etsi_its_denm_msgs",
    "denm-2.2.1": "etsi_its_denm_ts_msgs",
    "ivim-2.1.1": "etsi_its_ivim_ts_msgs",
    "mapem-2.1.1": "etsi_its_mapem_ts_msgs",
    "spatem-2.1.1": "etsi_its_spatem_ts_msgs",
}


def package_name(edition: str) -> str:
    """Of the package that holds an edition's messages: cam-2.3.1 is captain_cam_2_3_1_msgs."""
    words = edition.lower().replace("-", "_").replace(".", "_")
    return PACKAGES.get(edition) or f"captain_{words}_msgs"


def packages(schema: Schema, editions: Sequence[Message]) -> list[RosPackage]:
    """A package for each edition."""
    return [package(schema, edition) for edition in editions]


def package(schema: Schema, edition: Message) -> RosPackage:
    """All messages that the PDU of an edition reaches; of a DENM every subcause as well, though no field is one."""
    waiting = [edition.pdu]
    if edition.type == "denm":
        waiting += _subcauses(schema, edition)
    messages: dict[str, RosMessage] = {}
    while waiting:
        reference = waiting.pop()
        name = type_name(reference.name)
        if name in messages:
            continue
        maker = _Maker(schema, reference)
        messages[name] = maker.message()
        waiting += maker.reached
    tops = {edition.name: type_name(edition.pdu.name)}
    return RosPackage(package_name(edition.name), NAME, (edition,), tops, dict(sorted(messages.items())))


def _subcauses(schema: Schema, edition: Message) -> Iterator[Reference]:
    from asn1.selection import reached

    for key in sorted(reached(schema, {edition.pdu.module})):
        for name in schema.modules[key].definitions:
            if name.endswith("SubCauseCode"):
                yield Reference(module=key, name=name)


class _Maker:
    """The message of one definition, and the definitions that its fields refer to."""

    def __init__(self, schema: Schema, reference: Reference) -> None:
        self.schema = schema
        self.module = schema.modules[reference.module]
        self.definition: Definition = schema.resolve(reference)
        self.reached: list[Reference] = []
        self.left_out: list[Path] = []

    def message(self) -> RosMessage:
        fields = self.top(self.definition.type)
        return RosMessage(
            type_name(self.definition.name),
            self.module,
            self.definition,
            tuple(_tell_apart(fields)),
            tuple(self.left_out),
        )

    def top(self, type_: Type) -> list[RosField]:
        match type_:
            case SequenceType():
                return self.sequence(type_, ())
            case Choice():
                return self.choice(type_, (), "")
            case SequenceOf():
                return self.leaf(type_, (), "array", "")
            case _:
                return self.leaf(type_, (), "value", "")

    # ------------------------------------------------------------ what holds components

    def sequence(self, type_: SequenceType, path: Path) -> list[RosField]:
        """The components, those of a type without a name in place of the one that holds them."""
        fields: list[RosField] = []
        for component in components_of(type_):
            source = (*path, component.name)
            if _is_regional(component.type):
                self.left_out.append(source)
                continue
            found = self.component(component, source, "")
            if component.is_optional:
                found = _with_flag(found, component, source)
            fields += found
        return fields

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
            words = f"choice-{prefix}-{component.name}" if prefix else f"choice-{component.name}"
            constant = RosConstant("uint8", constant_name(words), number)
            found = self.component(component, source, prefix)
            if found:
                found[0] = replace(found[0], constants=(*found[0].constants, constant))
            else:
                numbers.append(constant)
            fields += found
        name = f"{field_name(prefix)}_choice" if prefix else "choice"
        return [
            RosField(
                "uint8", name, Role.CHOICE, (path,), options=tuple(options), constants=tuple(numbers), schema_type=type_
            ),
            *_shared(fields),
        ]

    def component(self, component: Component, source: Path, prefix: str) -> list[RosField]:
        """One component or alternative; prefix: name of the CHOICE without a name that it belongs to."""
        name = f"{prefix}-{component.name}" if prefix else component.name
        match component.type:
            case Null():
                return []
            case SequenceType():
                fields = self.sequence(component.type, source)
            case Choice():
                fields = self.choice(component.type, source, name)
            case OpenType():
                fields = self.open(component.type, source, name)
            case Enumerated():
                words = f"{prefix}-value" if prefix else name
                fields = self.leaf(component.type, source, words, words)
            case _:
                fields = self.leaf(component.type, source, name, name)
        if len(fields) and fields[0].sources == (source,):
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

    # ------------------------------------------------------------ what is a value

    def leaf(self, type_: Type, source: Path, name: str, prefix: str) -> list[RosField]:
        """One field; of a BIT STRING two. prefix: what constants begin with."""
        field = replace(self.plain(type_, prefix), name=field_name(name), sources=(source,), schema_type=type_)
        if not isinstance(type_, BitString):
            return [field]
        unused = RosField("uint8", "bits_unused", Role.BITS_UNUSED, (source,), constants=field.constants)
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
                return RosField(type_name(type_.name), "")
            case _:
                raise TypeError(f"{self.module.key}.{self.definition.name}: no field for {type(type_).__name__}")


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


def _is_regional(type_: Type) -> bool:
    if isinstance(type_, SequenceOf):
        return _is_regional(type_.element)
    return isinstance(type_, Reference) and type_.name.startswith("RegionalExtension")


def _with_flag(fields: list[RosField], component: Component, source: Path) -> list[RosField]:
    """Whether it is there, behind the first of its fields."""
    name = fields[0].name if fields else field_name(component.name)
    flag = RosField("bool", f"{name}_is_present", Role.PRESENT, (source,))
    return [*fields[:1], flag, *fields[1:]]


def _shared(fields: list[RosField]) -> list[RosField]:
    """Alternatives whose fields have one name and type share the field."""
    found: dict[str, RosField] = {}
    for field in fields:
        known = found.get(field.name)
        if known is None or known.text != field.text:
            found[field.name] = field
            continue
        sources, constants = (*known.sources, *field.sources), (*known.constants, *field.constants)
        found[field.name] = replace(known, sources=sources, constants=constants)
    return list(found.values())


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
