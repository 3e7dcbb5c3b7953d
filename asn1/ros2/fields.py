"""The fields of a message, from the definition that it stands for; how they are called, a profile says.

What all profiles do alike: components of a type without a name stand in place of the one that holds them; extension
markers are gone, groups flattened; regional extensions are left out; a component whose type holds the message again,
but for what WITH COMPONENTS takes away, stands there by its own components, because no .msg holds itself.
"""

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import replace

from asn1.ros2 import RosError
from asn1.ros2.model import Path, RosField, RosMessage, RosPackage
from asn1.ros2.names import field_name, file_name
from asn1.selection import components_of, references_of
from asn1.types import (
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
from asn1.types import Sequence as SequenceType


class Fields(ABC):
    """Of one definition. After `message`: the definitions that its fields refer to stand in `reached`."""

    def __init__(self, schema: Schema, reference: Reference) -> None:
        self.schema = schema
        self.reference = reference
        self.definition: Definition = schema.resolve(reference)
        self.reached: list[Reference] = []
        self.left_out: list[Path] = []
        self.unflagged: list[Path] = []

    # ------------------------------------------------------------ what a profile says

    @abstractmethod
    def name_of(self, reference: Reference) -> str:
        """Of the message of a definition."""

    @abstractmethod
    def value_name(self) -> str:
        """Of the one field of a message that is no SEQUENCE, CHOICE or list."""

    @abstractmethod
    def list_name(self) -> str:
        """Of the one field of a message that is a list."""

    @abstractmethod
    def choice(self, type_: Choice, path: Path, prefix: str) -> list[RosField]:
        """The number of the alternative, and the alternatives; prefix: of a CHOICE inside a type, its name."""

    @abstractmethod
    def open(self, type_: OpenType, source: Path, name: str) -> list[RosField]:
        """Of an open type."""

    @abstractmethod
    def leaf(self, type_: Type, source: Path, name: str) -> list[RosField]:
        """What holds no components. name: of the component, in words of ASN.1."""

    @abstractmethod
    def flagged(self, fields: list[RosField], component: Component, source: Path, is_addition: bool) -> list[RosField]:
        """With what says whether a component is there."""

    # ------------------------------------------------------------ what all do alike

    def message(self) -> RosMessage:
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
        """Components or alternatives that a message has fields for, and where they lie."""
        for component in components_of(type_):
            source = (*path, component.name)
            if is_regional(component.type):
                self.left_out.append(source)
            else:
                yield component, source

    def component(self, component: Component, source: Path, prefix: str) -> list[RosField]:
        """One component or alternative; prefix: what stands in front of its name."""
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
        """What an open type may hold: number and type, of those that have a name."""
        for row in self.schema.modules[type_.set_.module].sets[type_.set_.name].rows:
            if isinstance(row.type, Reference):
                yield row.value, row.type

    def identifier_type(self, type_: ClassField) -> Type:
        return self.schema.modules[type_.class_.module].classes[type_.class_.name].id_type

    def is_inlined(self, type_: Type) -> bool:
        """Whether a type holds the message that it is a component of, but for what its constraint takes away."""
        return bool(_absent(type_)) and self.reference in held(self.schema, type_)

    def inline(self, type_: Reference, source: Path, name: str) -> list[RosField]:
        """The components of a type in its place, its name in front, without those that may not be there."""
        target = self.schema.resolve(type_).type
        if not isinstance(target, SequenceType):
            raise RosError(f"{self.definition.name}: {type_.name} holds it and is no SEQUENCE")
        left = tuple(one for one in target.root if one.name not in _absent(type_))
        return self.sequence(replace(target, root=left), source, name)


def require_finite(package: RosPackage) -> None:
    """Raises RosError for a message that holds itself."""
    done: set[str] = set()

    def visit(message: RosMessage, above: tuple[str, ...]) -> None:
        if message.name in above:
            raise RosError(f"{package.name}: {message.name} holds itself, which no .msg can say")
        if message.name not in done:
            for part in package.parts(message):
                visit(part, (*above, message.name))
            done.add(message.name)

    for message in package.messages.values():
        visit(message, ())


def require_apart(package: RosPackage) -> None:
    """Raises RosError for two messages of which rosidl would make the same files."""
    files: dict[str, str] = {}
    for name in package.messages:
        other = files.setdefault(file_name(name), name)
        if other != name:
            raise RosError(f"{package.name}: the files of {other} and {name} would be called alike")


def joined(*words: str) -> str:
    """Names of ASN.1 to one, without the empty ones."""
    return "-".join(word for word in words if word)


def is_regional(type_: Type) -> bool:
    """RegionalExtension of ISO/TS 19091, or a list of it: what is in it depends on where."""
    if isinstance(type_, SequenceOf):
        return is_regional(type_.element)
    return isinstance(type_, Reference) and type_.name.startswith("RegionalExtension")


def _absent(type_: Type) -> set[str]:
    """Components that WITH COMPONENTS takes away."""
    roots = [constraint.root for constraint in type_.constraints]
    rows = [row for root in roots if isinstance(root, Inner) for row in root.components]
    return {row.name for row in rows if row.presence == "ABSENT"}


def held(schema: Schema, type_: Type) -> list[Reference]:
    """Every definition that a type holds, at any depth, in the order of the text; open types left out."""
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
    """No two fields, and no two constants, of one name: a second one has the name of what holds it in front."""
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
