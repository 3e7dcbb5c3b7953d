"""Profile v2x_msgs: messages as the users of vehicleCAPTAIN have them, all in one package.

Conventions, from the .msg files of v2x_msgs:

- Every number is an int64, also an item of an ENUMERATED, an octet, and a BIT STRING, in which bit i counts 2**i;
- A bool before an optional component says whether it is present;
- A CHOICE has a number, which is 0 if no alternative is chosen;
- A message with a single value names its field like itself;
- Every PDU has a list with a std_msgs/Header.

That package contains the editions that vehicleCAPTAIN has. Types of other editions have the same names but differ, so
each of these editions has a package of its own.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from asn1.backends.ros2.fields import Fields, held, joined, require_apart, require_finite
from asn1.backends.ros2.model import Path, Role, RosConstant, RosError, RosField, RosMessage, RosPackage
from asn1.backends.ros2.names import constant_name, field_name, file_name, type_name
from asn1.model.constraints import size_bounds, value_bounds
from asn1.model.selection import components_of
from asn1.model.types import (
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

NAME = "v2x_msgs"
NUMBER = "int64"
HEADER = "std_msgs/Header"
NOTHING = 0  # number of a CHOICE without a chosen alternative
# Field names of lists for which v2x_msgs deviates from its own rule.
LIST_NAMES = {"ProtectedCommunicationZonesRSU": "zonesrsu", "ISO14823Attributes": "o14823attributes"}

# Editions in the package v2x_msgs. Their types get names in this order: a later type with the same name has its module
# as suffix.
TOGETHER = (
    "cam-1.4.1", "denm-1.3.1", "spatem-2.1.1", "mapem-2.1.1", "ivim-2.1.1", "srem-2.1.1", "ssem-2.1.1", "rtcmem-2.1.1",
    "cpm-tr-2.1.1", "rawrx-1", "rawtx-1",
)  # fmt: skip


def package_name(edition: str) -> str:
    """Return the name of an edition's package."""
    return NAME if edition in TOGETHER else f"captain_v2x_{edition.lower().replace('-', '_').replace('.', '_')}_msgs"


def packages(schema: Schema, editions: Sequence[Message]) -> list[RosPackage]:
    """Return v2x_msgs, and a package for each other edition."""
    groups: dict[str, list[Message]] = {}
    for edition in editions:
        groups.setdefault(package_name(edition.name), []).append(edition)
    return [package(schema, name, group) for name, group in groups.items()]


def package(schema: Schema, name: str, editions: Sequence[Message]) -> RosPackage:
    """Return a package with all messages that the PDUs contain, and a list for each PDU.

    Raises RosError if a message would contain itself, which a .msg cannot express.
    """
    names = _Names(schema, editions)
    messages: dict[str, RosMessage] = {}
    waiting = [edition.pdu for edition in editions]
    tops = {edition.name: names.of(edition.pdu) for edition in editions}
    while waiting:
        reference = waiting.pop()
        if names.of(reference) in messages:
            continue
        fields = _Fields(schema, reference, names)
        made = fields.message()
        messages[made.name] = made
        waiting += fields.reached
    for top in tops.values():
        messages[f"{top}List"] = _list(messages[top])
    found = RosPackage(name, NAME, tuple(editions), tops, dict(sorted(messages.items())), ("std_msgs",))
    require_finite(found)
    require_apart(found)
    return found


def _list(message: RosMessage) -> RosMessage:
    fields = (
        RosField(HEADER, "header", Role.HEADER),
        RosField(message.name, f"{field_name(message.name)}s", Role.LIST, is_array=True),
    )
    return RosMessage(f"{message.name}List", message.module, message.definition, fields)


class _Names:
    """Unique names of definitions. A second type with the same name gets its module as suffix: SpeedConfidenceDSRC.

    For editions of v2x_msgs the names do not depend on the selected editions.
    """

    def __init__(self, schema: Schema, editions: Sequence[Message]) -> None:
        self.schema = schema
        self.known: dict[tuple[str, str], str] = {}
        self.taken: dict[str, tuple[str, Definition]] = {}
        together = [schema.messages[name] for name in TOGETHER if name in schema.messages]
        for edition in together if editions[0] in together else editions:
            for reference in held(schema, edition.pdu):
                self.of(reference)

    def of(self, reference: Reference) -> str:
        key = reference.module, reference.name
        if key not in self.known:
            definition = self.schema.resolve(reference)
            name = _capitals(reference.name)
            if not self._is_free(name, definition):
                name += type_name(reference.module.partition("_")[2]).upper()
            if not self._is_free(name, definition):
                raise RosError(f"{name}: three types have this name")
            self.known[key] = name
        return self.known[key]

    def _is_free(self, name: str, definition: Definition) -> bool:
        """Return whether no other type has the name, or one for which rosidl would use the same files."""
        return self.taken.setdefault(file_name(name), (name, definition)) == (name, definition)


def _capitals(name: str) -> str:
    """Return the name with a capital for each part: InternationalSign-speedLimits is InternationalSignSpeedLimits."""
    return type_name("".join(word[:1].upper() + word[1:] for word in name.split("-")))


class _Fields(Fields):
    def __init__(self, schema: Schema, reference: Reference, names: _Names) -> None:
        super().__init__(schema, reference)
        self.names = names

    def name_of(self, reference: Reference) -> str:
        return self.names.of(reference)

    def value_name(self) -> str:
        return self.definition.name

    def list_name(self) -> str:
        """Return the last word of the type's name: `history` for PathHistory, `xylist` for NodeAttributeXYList."""
        name = self.definition.name
        return LIST_NAMES.get(name) or field_name(re.split("(?<=[a-z0-9])(?=[A-Z])", name)[-1].lower())

    def flagged(self, fields: list[RosField], component: Component, source: Path, is_addition: bool) -> list[RosField]:
        """Add a presence flag before the fields of an optional component or an addition."""
        if not (component.is_optional or component.default is not None or is_addition):
            return fields
        return [RosField("bool", f"{field_name(component.name)}_present", Role.PRESENT, source), *fields]

    def choice(self, type_: Choice, path: Path, prefix: str) -> list[RosField]:
        """Return the field `<name>_container_select`, and the alternatives with their own names."""
        owner = prefix or self.definition.name
        numbers = {one.name: number for number, one in enumerate(components_of(type_), NOTHING + 1)}
        fields: list[RosField] = []
        options: list[tuple[int, str]] = []
        for component, source in self.parts(type_, path):
            options.append((numbers[component.name], component.name))
            fields += self.component(component, source, "")
        constants = [
            RosConstant(NUMBER, constant_name(joined(owner, name)), number)
            for number, name in [(NOTHING, "nothing"), *options]
        ]
        name = f"{field_name(owner)}_container_select"
        select = RosField(
            NUMBER, name, Role.CHOICE, path, options=tuple(options), nothing=NOTHING, constants=tuple(constants)
        )
        return [select, *fields]

    def open(self, type_: OpenType, source: Path, name: str) -> list[RosField]:
        return [
            field
            for number, row in self.rows(type_)
            for field in self.leaf(row, (*source, str(number)), f"{name}-{row.name[:1].lower()}{row.name[1:]}")
        ]

    def leaf(self, type_: Type, source: Path, name: str) -> list[RosField]:
        field = self.plain(type_, name)
        return [replace(field, name=field_name(name), source=source, schema_type=type_)]

    def plain(self, type_: Type, prefix: str) -> RosField:
        """Return a field with type and constants."""
        match type_:
            case Boolean():
                return RosField("bool", "")
            case Integer():
                bounds = value_bounds(type_.constraints)
                limits = (("RANGE_MIN", bounds.low), ("RANGE_MAX", bounds.high))
                return RosField(NUMBER, "", constants=(*_limits(limits, prefix), *_named(type_.names, prefix)))
            case Enumerated():
                return RosField(NUMBER, "", constants=tuple(_named((*type_.root, *type_.additions), prefix)))
            case BitString():
                return RosField(NUMBER, "", constants=tuple(_named(type_.names, prefix)))
            case OctetString():
                return RosField(NUMBER, "", is_array=True, constants=_sizes(type_, prefix))
            case CharacterString() | ObjectIdentifier():
                return RosField("string", "")
            case SequenceOf():
                element = self.plain(type_.element, prefix)
                return RosField(element.type, "", is_array=True, constants=_sizes(type_, prefix))
            case ClassField():
                return self.plain(self.identifier_type(type_), prefix)
            case Reference():
                self.reached.append(type_)
                return RosField(self.name_of(type_), "")
            case _:
                raise TypeError(f"{self.definition.name}: no field for {type(type_).__name__}")


def _limits(limits: Sequence[tuple[str, int | None]], prefix: str) -> Iterator[RosConstant]:
    for name, value in limits:
        if value is not None:
            yield RosConstant(NUMBER, constant_name(name, prefix), value)


def _sizes(type_: Type, prefix: str) -> tuple[RosConstant, ...]:
    bounds = size_bounds(type_.constraints)
    return tuple(_limits((("SIZE_MIN", bounds.low), ("SIZE_MAX", bounds.high)), prefix))


def _named(names: Sequence[Named], prefix: str) -> Iterator[RosConstant]:
    for item in names:
        yield RosConstant(NUMBER, constant_name(item.name, prefix), item.value)
