"""Package of ROS 2 messages, with the place of each field in a value of the schema.

Writers of text (.msg) read names, types and constants. Writers of code read the sources. A source is a path from the
value of the message to the value of the field: names of components and alternatives, as in ASN.1.

    r1_cam.CamParameters -> CamParameters.msg
      LowFrequencyContainer low_frequency_container       VALUE    ("lowFrequencyContainer",)
      bool low_frequency_container_is_present             PRESENT  ("lowFrequencyContainer",)
    r1_cam.LowFrequencyContainer -> LowFrequencyContainer.msg
      uint8 choice                                        CHOICE   (), options ((0, "basicVehicleContainer..."),)
      BasicVehicle... basic_vehicle_...                   VALUE    ("basicVehicleContainer...",)
    r1_cdd.SpeedValue -> SpeedValue.msg
      uint16 value                                        VALUE    ()

A path goes through a SEQUENCE by the name of a component, and through a CHOICE by that of an alternative. It goes
through an open type by the number of its row. It goes into a list only through a message. A field that is an array of
messages leads to the list; the sources in these messages begin at the elements. If a message is another name of the
same type (`A ::= B`), its one field has the path (): the same value, seen as B.

In a message from the air, an absent component or alternative is zero, false, or empty in all its fields. In a message
from a node, such fields are ignored. An optional component without a flag (`RosMessage.unflagged`) is present if any
of its fields is neither zero, false nor empty. One with a DEFAULT is present unless it has that value. A message
without any field is one octet of zero on the wire.

Profile v2x_msgs has for a BIT STRING a number, in which bit i of the string counts 2**i. Where the size varies, the
string has the smallest size that is allowed and holds the highest bit that is set.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

from asn1.backends.backend import BackendError
from asn1.model.types import Component, Definition, Message, Module, Type

Path = tuple[str, ...]
"""Path from the value of a message to that of a field.

A step into a SEQUENCE or CHOICE is the name of a component or alternative. A step into an open type is the number of
the row that gives its type.
"""


class RosError(BackendError):
    """A message that ROS 2 cannot represent; str() gives the message and the reason."""


class Role(StrEnum):
    """Content of a field, relative to its source."""

    VALUE = "value"
    PRESENT = "present"  # bool: the source is present
    # number of the chosen alternative of the CHOICE at the source; `options` maps numbers to alternatives
    CHOICE = "choice"
    BITS_UNUSED = "bits unused"  # number of unused bits in the last octet of the BIT STRING at the source
    HEADER = "header"  # std_msgs/Header; the schema has no such value
    LIST = "list"  # list of whole messages, built by the sender; the schema has no such value


@dataclass(frozen=True, slots=True)
class RosConstant:
    """A constant of a .msg file. It is not part of the hash."""

    type: str
    name: str
    value: int


@dataclass(frozen=True, slots=True)
class RosField:
    """A line of a .msg file, and its constants.

    type         bool, uint8 ... int64, string, or a message: of the same package, or "std_msgs/Header"
    is_array     unbounded array: elements of a SEQUENCE OF, octets of an OCTET STRING or BIT STRING (first bit highest)
    options      CHOICE: number and alternative
    nothing      CHOICE: number that means no alternative; None without one
    schema_type  type of the source, for comments and units
    component    component at the source, for its unit and default; None without one
    """

    type: str
    name: str
    role: Role = Role.VALUE
    source: Path = ()
    is_array: bool = False
    options: tuple[tuple[int, str], ...] = ()
    nothing: int | None = None
    constants: tuple[RosConstant, ...] = ()
    schema_type: Type | None = None
    component: Component | None = None

    @property
    def text(self) -> str:
        """Line of the .msg file."""
        return f"{self.type}{'[]' if self.is_array else ''} {self.name}"


@dataclass(frozen=True, slots=True)
class RosMessage:
    """A .msg file.

    module, definition   type of the schema that it represents; for a list of messages (v2x_msgs) the PDU
    left_out             paths of components for which the message has no field (regional extensions)
    unflagged            paths of optional components for which the message has no presence flag
    """

    name: str
    module: Module
    definition: Definition
    fields: tuple[RosField, ...]
    left_out: tuple[Path, ...] = ()
    unflagged: tuple[Path, ...] = ()


@dataclass(frozen=True, slots=True)
class RosPackage:
    """An ament package of messages.

    editions    messages of the schema that it covers
    tops        their names, with the names of their ROS messages
    messages    ROS messages by name, sorted
    depends     packages of other projects with types of its fields (std_msgs)
    """

    name: str
    profile: str
    editions: tuple[Message, ...]
    tops: Mapping[str, str]
    messages: Mapping[str, RosMessage]
    depends: tuple[str, ...] = ()

    def top(self, edition: str) -> RosMessage:
        """Return the ROS message of an edition of the schema ("cam-1.4.1")."""
        return self.messages[self.tops[edition]]

    def parts(self, message: RosMessage) -> Iterator[RosMessage]:
        """Yield the messages of this package that the fields of a message contain."""
        for field in message.fields:
            if field.type in self.messages:
                yield self.messages[field.type]
