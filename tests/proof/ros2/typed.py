"""Values of every message through the gateway and a real node, and back to the same UPER."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from asn1.backends.ros2.model import RosPackage
from firmware.gateway.captain_gateway.captain_gateway.handlers import KINDS
from tests.proof.ros2 import codec, ros, stations
from tests.proof.ros2.rows import Row

VALUES = 200  # of each message, every other of them of a newer sender
LISTS = "v2x_msgs"  # the profile that has lists of each message as well
LOG = ros.MADE / "gateway_typed.log"


def travel(packages: list[RosPackage]) -> Iterator[Row]:
    """A row for each message. The packages have to be built."""
    folder = codec.made(packages)
    for package in packages:
        for edition in package.tops:
            yield _row(package, edition, folder)
            if package.profile == LISTS:
                yield _row(package, edition, folder, "List")


def _row(package: RosPackage, edition: str, folder: Path, suffix: str = "") -> Row:
    """suffix: of the type that topics carry."""
    what = f"{edition} as {package.name}/{package.tops[edition]}{suffix}"
    handler = next((kind.name for kind in KINDS.values() if edition in kind.editions), "")
    try:
        if handler:
            return _result(what, handler, _through_gateway(package, edition, handler, folder, suffix))
        script = "typed.py", str(folder), edition, package.profile, str(VALUES)
        return _result(what, handler, json.loads(ros.inside(*script)))
    except ros.RosError as error:
        return Row(what, "ended early", str(error))


def _through_gateway(package: RosPackage, edition: str, handler: str, folder: Path, suffix: str) -> Any:
    chosen = {
        "handlers": f"[{handler}]", f"{handler}.edition": edition, "profile": package.profile, "lists": str(bool(suffix)).lower(),
    }  # fmt: skip
    words = [word for name, value in chosen.items() for word in ("-p", f"{name}:={value}")]
    with stations.played() as ports, stations.gateway(folder, ports, LOG, ros.INSTALLED, *words):
        script = "typed.py", folder, edition, package.profile, str(VALUES), json.dumps(ports), handler, suffix
        return stations.inside(*script, codec=folder, prefix=ros.INSTALLED)


def _result(what: str, handler: str, said: Any) -> Row:
    way = f"station, gateway, {handler}/received" if handler else "no type of the air: without the gateway"
    found = (
        f"{said['back'] + said['original']} of {said['values']} identical after a typed subscription ({way}), "
        f"{said['original']} of them with what was kept beside"
    )
    if said["cut"]:
        found += f"; {said['cut']} more hold a string with a NUL, where rclpy ends it: left out"
    return Row(what, found, said["trouble"])
