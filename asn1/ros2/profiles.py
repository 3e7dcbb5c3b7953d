"""The profiles by name: whose names and types the messages have."""

from collections.abc import Callable, Sequence

from asn1.ros2 import profile_etsi_its, profile_v2x_msgs
from asn1.ros2.model import RosPackage
from asn1.types import Message, Schema

PROFILES: dict[str, Callable[[Schema, Sequence[Message]], list[RosPackage]]] = {
    profile_etsi_its.NAME: profile_etsi_its.packages,
    profile_v2x_msgs.NAME: profile_v2x_msgs.packages,
}


def packages(schema: Schema, editions: Sequence[Message], profile: str = profile_etsi_its.NAME) -> list[RosPackage]:
    """All packages for some editions. Raises RosError where a message cannot be said in ROS 2."""
    return PROFILES[profile](schema, editions)
