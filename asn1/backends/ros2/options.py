"""Options of ROS 2 messages: names of profiles and distributions."""

from typing import NamedTuple

PROFILES = {
    "etsi_its": "as in etsi_its_messages, whose nodes, bags and displays accept them",
    "v2x_msgs": "as in v2x_msgs of vehicleCAPTAIN",
}
DISTROS = ("jazzy", "humble", "kilted")


class Ros2Options(NamedTuple):
    """Options of ROS 2: names of the messages, distribution, and conversion code.

    with_cdr  add C code that converts to serialised ROS 2 messages and back, in every profile. Programs that do not use
              it do not link it.
    """

    profile: str = "etsi_its"
    distro: str = "jazzy"
    with_cdr: bool = False
