"""A package of ROS 2 messages, and where each of its fields lies in a value of the schema.

Writers of text (.msg) read names, types and constants; writers of code read the sources: a path of names of components
and alternatives, as they are called in ASN.1, from the value of the message down to what the field holds.

    r1_cam.CamParameters -> CamParameters.msg
      LowFrequencyContainer low_frequency_container       VALUE    ("lowFrequencyContainer",)
      bool low_frequency_container_is_present             PRESENT  ("lowFrequencyContainer",)
    r1_cam.LowFrequencyContainer -> LowFrequencyContainer.msg
      uint8 choice                                        CHOICE   (), options ((0, "basicVehicleContainer..."),)
      BasicVehicle... basic_vehicle_...                   VALUE    ("basicVehicleContainer...",)
    r1_cdd.SpeedValue -> SpeedValue.msg
      uint16 value                                        VALUE    ()

A path goes through a SEQUENCE by the name of a component, through a CHOICE by that of an alternative, and through an
open type by the number of its row. It goes into a list only by way of a message: a field that is an array of messages
leads to the list, and the source of theirs begins at its elements. Where a message stands for another name of
the same type (`A ::= B`), its one field has the path (): the same value, seen as B.

In a message from the standard, what is absent (a component, an alternative that is not chosen) is zero, false, or
empty in all its fields; in a message from a node, such fields are not looked at. Where a component may be absent and
no field says so (`RosMessage.unflagged`), it is there if any of its fields is neither zero, false nor empty. One that
has a DEFAULT is there unless it has that value. A message without any field is one octet of zero on the wire.

Profile v2x_msgs has for a BIT STRING a number, in which bit i of the string counts 2**i. Where the size varies, the
string has the smallest size that is allowed and holds the highest bit that is set.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

from asn1.types import Component, Definition, Message, Module, Type

Path = tuple[str, ...]
"""Names of components and alternatives, and numbers of rows of open types."""


class Role(StrEnum):
    """What of its source a field holds."""

    VALUE = "value"
    PRESENT = "present"  # bool: is there something at the source
    CHOICE = "choice"  # number: which alternative of the CHOICE at the source; options say which is which
    BITS_UNUSED = "bits unused"  # number: of the last octet of the BIT STRING at the source
    HEADER = "header"  # std_msgs/Header: from no value of the schema
    LIST = "list"  # whole messages, of whoever makes the list: from no value of the schema


@dataclass(frozen=True, slots=True)
class RosConstant:
    """A constant is not part of the hash."""

    type: str
    name: str
    value: int


@dataclass(frozen=True, slots=True)
class RosField:
    """A line of a .msg file, and the constants behind it.

    type        bool, uint8 ... int64, string, or a message: of the same package, or "std_msgs/Header"
    is_array    without a bound: elements of a SEQUENCE OF, octets of an OCTET STRING or BIT STRING (first bit highest)
    options     CHOICE: number and alternative
    nothing     CHOICE: the number that says that no alternative is chosen; None where there is none
    schema_type of what lies at the source, for comments and units
    component   that leads there, for its unit and default; None where there is none
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
        """The line."""
        return f"{self.type}{'[]' if self.is_array else ''} {self.name}"


@dataclass(frozen=True, slots=True)
class RosMessage:
    """A .msg file.

    module, definition   the type of the schema that it stands for; of a list of messages (v2x_msgs) the PDU
    left_out             sources of what the standard has and the message has no field for (regional extensions)
    unflagged            sources of what may be absent, and no field says whether it is
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

    tops        messages of the schema that it is for: their name to that of their ROS message
    messages    by name, sorted
    depends     packages of other people that its fields come from (std_msgs)
    """

    name: str
    profile: str
    editions: tuple[Message, ...]
    tops: Mapping[str, str]
    messages: Mapping[str, RosMessage]
    depends: tuple[str, ...] = ()

    def top(self, edition: str) -> RosMessage:
        """The message of an edition of the schema ("cam-1.4.1")."""
        return self.messages[self.tops[edition]]

    def parts(self, message: RosMessage) -> Iterator[RosMessage]:
        """The messages of this package that the fields of one hold."""
        for field in message.fields:
            if field.type in self.messages:
                yield self.messages[field.type]
