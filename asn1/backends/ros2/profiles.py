"""Profiles by name: functions that return their packages."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from asn1.backends.ros2 import profile_etsi_its, profile_v2x_msgs
from asn1.backends.ros2.model import RosPackage
from asn1.model.types import Message, Schema

PROFILES: dict[str, Callable[[Schema, Sequence[Message]], list[RosPackage]]] = {
    profile_etsi_its.NAME: profile_etsi_its.packages,
    profile_v2x_msgs.NAME: profile_v2x_msgs.packages,
}


def packages(schema: Schema, editions: Sequence[Message], profile: str = profile_etsi_its.NAME) -> list[RosPackage]:
    """Return all packages of some editions. Raises RosError for a message that ROS 2 cannot represent.

    Both forms of a message (Message.form_of) have the same ROS type.
    """
    strict = dict.fromkeys(schema.messages[edition.form_of] if edition.form_of else edition for edition in editions)
    return [_with_forms(package, editions) for package in PROFILES[profile](schema, list(strict))]


def _with_forms(package: RosPackage, editions: Sequence[Message]) -> RosPackage:
    """Return the package with the requested forms in place of the strict ones.

    If both forms of a message were requested, `editions` has the strict one.
    """
    of = {edition.name: edition.form_of or edition.name for edition in editions}
    asked = {of[edition.name]: edition for edition in sorted(editions, key=lambda edition: not edition.form_of)}
    return replace(
        package,
        editions=tuple(asked[strict.name] for strict in package.editions),
        tops={name: package.tops[strict] for name, strict in of.items() if strict in package.tops},
    )
