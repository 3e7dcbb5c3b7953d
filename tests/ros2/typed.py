"""Values of every message through a real node, and back to the same UPER."""

import json

from asn1.ros2.model import RosPackage
from tests.ros2 import codec, ros
from tests.ros2.rows import Row

VALUES = 200  # of each message, every other of them of a newer sender


def travel(packages: list[RosPackage]) -> list[Row]:
    """A row for each message. The packages have to be built."""
    folder = codec.made(packages)
    return [_row(package, edition, str(folder)) for package in packages for edition in package.tops]


def _row(package: RosPackage, edition: str, folder: str) -> Row:
    what = f"{edition} as {package.name}/{package.tops[edition]}"
    try:
        return _travelled(what, package, edition, folder)
    except ros.RosError as error:
        return Row(what, "ended early", str(error))


def _travelled(what: str, package: RosPackage, edition: str, folder: str) -> Row:
    said = json.loads(ros.inside("typed.py", folder, edition, package.profile, str(VALUES)))
    found = (
        f"{said['back'] + said['original']} of {said['values']} identical after a typed subscription, "
        f"{said['original']} of them with what was kept beside"
    )
    if said["cut"]:
        found += f"; {said['cut']} hold a string with a NUL, where rclpy ends it"
    return Row(what, found, said["trouble"])
