"""The profiles by name: whose names and types the messages have."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from asn1.ros2 import profile_etsi_its, profile_v2x_msgs
from asn1.ros2.model import RosPackage
from asn1.types import Message, Schema

PROFILES: dict[str, Callable[[Schema, Sequence[Message]], list[RosPackage]]] = {
    profile_etsi_its.NAME: profile_etsi_its.packages,
    profile_v2x_msgs.NAME: profile_v2x_msgs.packages,
}


def packages(schema: Schema, editions: Sequence[Message], profile: str = profile_etsi_its.NAME) -> list[RosPackage]:
    """All packages for some editions. Raises RosError where a message cannot be said in ROS 2.

    Both forms of a message (Message.form_of) have one ROS type.
    """
    strict = dict.fromkeys(schema.messages[edition.form_of] if edition.form_of else edition for edition in editions)
    return [_with_forms(package, editions) for package in PROFILES[profile](schema, list(strict))]


def _with_forms(package: RosPackage, editions: Sequence[Message]) -> RosPackage:
    of = {edition.name: edition.form_of or edition.name for edition in editions}
    return replace(package, tops={name: package.tops[strict] for name, strict in of.items() if strict in package.tops})
