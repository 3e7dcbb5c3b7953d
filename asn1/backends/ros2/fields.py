"""Fields of a ROS message from a definition of the schema; a profile names them.

Common to all profiles:

- An unnamed SEQUENCE or CHOICE in a component has no message of its own. Its components become fields of the message;
- Extension markers are gone, groups are flattened, regional extensions are left out;
- A component may contain the message again, without the parts that WITH COMPONENTS removes. Its own components replace
  it, because a .msg cannot contain itself.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import replace

from asn1.backends.ros2.model import Path, RosError, RosField, RosMessage, RosPackage
from asn1.backends.ros2.names import field_name, file_name
from asn1.model.selection import components_of, references_of
from asn1.model.types import (
    Choice,
    ClassField,
    Component,
    Definition,
    Inner,
    Null,
    OpenType,
    Reference,
    Schema,
    SequenceOf,
    Type,
)
from asn1.model.types import Sequence as SequenceType


class Fields(ABC):
    """Fields of one definition's message. After `message`, `reached` has the definitions that they refer to."""

    def __init__(self, schema: Schema, reference: Reference) -> None:
        self.schema = schema
        self.reference = reference
        self.definition: Definition = schema.resolve(reference)
        self.reached: list[Reference] = []
        self.left_out: list[Path] = []
        self.unflagged: list[Path] = []

    # ------------------------------------------------------------ rules of a profile

    @abstractmethod
    def name_of(self, reference: Reference) -> str:
        """Return the name of a definition's ROS message."""

    @abstractmethod
    def value_name(self) -> str:
        """Return the name of the single field, for a type other than SEQUENCE, CHOICE or list."""

    @abstractmethod
    def list_name(self) -> str:
        """Return the name of the single field of a list's message."""

    @abstractmethod
    def choice(self, type_: Choice, path: Path, prefix: str) -> list[RosField]:
        """Return the number of the alternative, and the alternatives. prefix: name of an unnamed CHOICE, else ""."""

    @abstractmethod
    def open(self, type_: OpenType, source: Path, name: str) -> list[RosField]:
        """Return the fields of an open type."""

    @abstractmethod
    def leaf(self, type_: Type, source: Path, name: str) -> list[RosField]:
        """Return the fields of a type without components. name: ASN.1 name of the component."""

    @abstractmethod
    def flagged(self, fields: list[RosField], component: Component, source: Path, is_addition: bool) -> list[RosField]:
        """Return the fields, with a presence flag if the component needs one."""

    # ------------------------------------------------------------ common rules

    def message(self) -> RosMessage:
        """Return the message of the definition. Raises RosError if two fields have the same name."""
        fields = tuple(_tell_apart(self.top(self.definition.type)))
        module = self.schema.modules[self.reference.module]
        name = self.name_of(self.reference)
        return RosMessage(name, module, self.definition, fields, tuple(self.left_out), tuple(self.unflagged))

    def top(self, type_: Type) -> list[RosField]:
        match type_:
            case SequenceType():
                return self.sequence(type_, (), "")
            case Choice():
                return self.choice(type_, (), "")
            case Null():
                return []
            case SequenceOf():
                return self.leaf(type_, (), self.list_name())
            case _:
                return self.leaf(type_, (), self.value_name())

    def sequence(self, type_: SequenceType, path: Path, prefix: str) -> list[RosField]:
        in_root = (*type_.root, *type_.tail)
        fields: list[RosField] = []
        for component, source in self.parts(type_, path):
            found = self.component(component, source, prefix)
            fields += self.flagged(found, component, source, component not in in_root)
        return fields

    def parts(self, type_: SequenceType | Choice, path: Path) -> Iterator[tuple[Component, Path]]:
        """Yield components or alternatives that have fields, with their paths. Regional extensions are left out."""
        for component in components_of(type_):
            source = (*path, component.name)
            if is_regional(component.type):
                self.left_out.append(source)
            else:
                yield component, source

    def component(self, component: Component, source: Path, prefix: str) -> list[RosField]:
        """Return the fields of one component or alternative. prefix: prefix of its name."""
        name = joined(prefix, component.name)
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
                fields = self.leaf(component.type, source, name)
        if fields and fields[0].source == source:
            fields[0] = replace(fields[0], component=component)
        return fields

    def rows(self, type_: OpenType) -> Iterator[tuple[int, Reference]]:
        """Yield number and type of an open type's rows, if the type has a name."""
        for row in self.schema.modules[type_.set_.module].sets[type_.set_.name].rows:
            if isinstance(row.type, Reference):
                yield row.value, row.type

    def identifier_type(self, type_: ClassField) -> Type:
        return self.schema.modules[type_.class_.module].classes[type_.class_.name].id_type

    def is_inlined(self, type_: Type) -> bool:
        """Return whether a type contains the message itself, in a component that WITH COMPONENTS restricts."""
        return bool(_absent(type_)) and self.reference in held(self.schema, type_)

    def inline(self, type_: Reference, source: Path, name: str) -> list[RosField]:
        """Return the fields of the components of a type, with its name as prefix, without those that must be absent.

        Raises RosError if the type is not a SEQUENCE.
        """
        target = self.schema.resolve(type_).type
        if not isinstance(target, SequenceType):
            raise RosError(f"{self.definition.name}: type {type_.name} contains this type and is not a SEQUENCE")
        left = tuple(one for one in target.root if one.name not in _absent(type_))
        return self.sequence(replace(target, root=left), source, name)


def require_finite(package: RosPackage) -> None:
    """Check that no message contains itself. Raises RosError for one that does."""
    done: set[str] = set()

    def visit(message: RosMessage, above: tuple[str, ...]) -> None:
        if message.name in above:
            raise RosError(f"{package.name}: type {message.name} contains itself; a .msg file cannot be recursive")
        if message.name not in done:
            for part in package.parts(message):
                visit(part, (*above, message.name))
            done.add(message.name)

    for message in package.messages.values():
        visit(message, ())


def require_apart(package: RosPackage) -> None:
    """Check that rosidl gives all messages different file names. Raises RosError for two with the same."""
    files: dict[str, str] = {}
    for name in package.messages:
        other = files.setdefault(file_name(name), name)
        if other != name:
            raise RosError(f"{package.name}: the messages {other} and {name} would have the same file name")


def joined(*words: str) -> str:
    """Return ASN.1 names joined by "-"; empty ones are skipped."""
    return "-".join(word for word in words if word)


def is_regional(type_: Type) -> bool:
    """Return whether a type is RegionalExtension of ISO/TS 19091, or a list of it.

    Its contents depend on the region.
    """
    if isinstance(type_, SequenceOf):
        return is_regional(type_.element)
    return isinstance(type_, Reference) and type_.name.startswith("RegionalExtension")


def _absent(type_: Type) -> set[str]:
    """Return the components that WITH COMPONENTS marks ABSENT."""
    roots = [constraint.root for constraint in type_.constraints]
    rows = [row for root in roots if isinstance(root, Inner) for row in root.components]
    return {row.name for row in rows if row.presence == "ABSENT"}


def held(schema: Schema, type_: Type) -> list[Reference]:
    """Return every definition that a type contains, at any depth, in the order of the text, except in open types."""
    found: dict[Reference, None] = {}

    def visit(inner: Type) -> None:
        for one in references_of(inner):
            plain = replace(one, constraints=())
            if plain not in found and plain.name in schema.modules[plain.module].definitions:
                found[plain] = None
                visit(schema.resolve(plain).type)

    visit(type_)
    return list(found)


def _tell_apart(fields: list[RosField]) -> Iterator[RosField]:
    """Yield the fields with unique names: a duplicate name gets that of its container as prefix.

    Duplicate constants are dropped. Raises RosError if a duplicate field name remains.
    """
    taken: set[str] = set()
    for field in fields:
        name = field.name
        for word in reversed(field.source):
            if name not in taken:
                break
            if name != field_name(word):
                name = f"{field_name(word)}_{name}"
        if name in taken:
            raise RosError(f"two fields are called {name}")
        constants = []
        for constant in field.constants:
            if constant.name not in taken:
                taken.add(constant.name)
                constants.append(constant)
        taken.add(name)
        yield replace(field, name=name, constants=tuple(constants))
