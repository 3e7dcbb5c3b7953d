"""captain ros2: the gateway to ROS 2, by the Python of the ROS that is sourced."""

import argparse
import json
import os
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from board import tool
from board.errors import StationError
from firmware.user.arguments import station

DESCRIPTION = """\
Starts the gateway between a station and ROS 2: a node, captain_gateway, with a
topic for each type of message that is received, and one for each that is to be
sent. It runs where ROS is, on this machine; the station may be on another.

The gateway is no part of this program. It is run by the python3 of the ROS
that is sourced, which needs: rclpy and the common interfaces; pyzmq;
captain_messages, the message library as a wheel; captain_gateway, which is
built by colcon, or lies beside this program's sources; and at least one package
of messages. What is missing is told, with how to get it.
"""
EPILOG = """\
examples:
  captain ros2                              a station of this machine
  captain ros2 --station 10.0.0.7           one elsewhere on the network
  captain ros2 --check                      what there is, and what is missing
  captain ros2 --ros-args -p profile:=v2x_msgs -r __ns:=/car
                                            everything behind --ros-args is
                                            ROS's own

exit codes:
  0    the node was ended by Ctrl-C; with --check: nothing is missing
  1    something is missing
  2    wrong usage
"""
PROBE_S = 30.0
# Asked of the other Python; what it says goes to its last line, because a ROS may print while it is imported.
PROBE = """
import json, importlib, pkgutil, re, sys
found = {"python": sys.version.split()[0], "executable": sys.executable}
names = ("rclpy", "zmq", "captain_messages", "captain_gateway", "captain_gateway_msgs")
for name in names + ("diagnostic_msgs", "geometry_msgs", "sensor_msgs", "tf2_msgs"):
    try:
        module = importlib.import_module(name if name in names else name + ".msg")
        found[name] = getattr(module, "__file__", None) or "yes"
        if name == "captain_messages" and not hasattr(module, "CdrError"):
            found[name] = "without ROS"
    except Exception as error:
        found["no " + name] = f"{type(error).__name__}: {error}"
ours = re.compile("etsi_its_.*_msgs|v2x_msgs|captain_(?!gateway_).*_msgs")
packages = sorted(one.name for one in pkgutil.iter_modules() if ours.fullmatch(one.name))
found["messages" if packages else "no messages"] = ", ".join(packages) or "no package of messages is installed"
print(json.dumps(found))
"""
# What Debian 12 and Ubuntu 24.04, of which Jazzy is, have pip say (PEP 668), and what does no harm there.
PIP = "python3 -m pip install (where that is refused as externally managed: with --user --break-system-packages)"
WHEEL = f"captain-asn1 generate --all --form wheel --ros2 --to DIR, then {PIP} DIR/*.whl"
COMMON = (
    "apt-get install ros-<distribution>-common-interfaces, or beside the wheel of rclpy python3 -m pip install "
    "ros-jazzy-common-interfaces"
)
REMEDIES = {
    "rclpy": "source a ROS 2: . /opt/ros/jazzy/setup.bash; where there is none: https://docs.ros.org, or to try "
    "things out python3 -m pip install 'ros-jazzy-rclpy[fastrtps]' ros-jazzy-common-interfaces (x86-64, Python 3.11 "
    "and 3.12)",
    "zmq": f"apt-get install python3-zmq, or {PIP} pyzmq",
    "captain_messages": WHEEL,
    "captain_gateway": "copy firmware/gateway of captain's sources into the src of a colcon workspace, colcon build, "
    "and source its install/setup.bash",
    "diagnostic_msgs": COMMON,
    "geometry_msgs": COMMON,
    "sensor_msgs": COMMON,
    "messages": "captain-asn1 generate cam-1.4.1 denm-1.3.1 --form ros2 --to DIR, build them by colcon, and source "
    "their setup file",
}
# What it runs without, and what it does not do then.
OPTIONAL = {
    "captain_gateway_msgs": "no metadata, no requests, no services; colcon builds it",
    "tf2_msgs": "own pose is not on /tf; apt-get install ros-<distribution>-tf2-msgs",
}
OLDEST = (3, 10)


def arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--station",
        metavar="HOST[:PORT]",
        type=station,
        help="its host and the port that users publish to; the others follow: +1 to users, +2 PULL, +3 reports",
    )
    parser.add_argument("--check", action="store_true", help="say what is there, and start nothing")
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], help="arguments of ROS: all that follow")


def main(arguments: argparse.Namespace) -> int:
    environment = with_sources(tool.environment() or os.environ, sources())
    found = probe(environment)
    lacking = missing(found)
    if arguments.check:
        print("\n".join(told(found, lacking)))
        return 1 if lacking else 0
    if lacking:
        first, *others = lacking
        more = f" (and {len(others)} more: captain ros2 --check)" if others else ""
        raise StationError(first.what + more, first.remedy)
    command = [found["executable"], "-m", "captain_gateway", "--ros-args", *_station(arguments.station)]
    return os.execve(command[0], [*command, *arguments.ros_args], environment)


def sources() -> Path | None:
    """Where the gateway lies beside this program's sources; None in a binary, which has none of it."""
    place = Path(__file__).resolve().parents[1] / "gateway" / "captain_gateway"
    return place if (place / "captain_gateway" / "__init__.py").is_file() else None


def with_sources(environment: Mapping[str, str], place: Path | None) -> dict[str, str]:
    """So that a gateway that is installed there goes before that of the sources."""
    if place is None:
        return dict(environment)
    before = environment.get("PYTHONPATH", "")
    return {**environment, "PYTHONPATH": f"{before}:{place}" if before else str(place)}


def probe(environment: Mapping[str, str]) -> dict[str, str]:
    """What the python3 of an environment has: module -> where, or "no <module>" -> why not. Raises StationError."""
    python = shutil.which("python3", path=environment.get("PATH"))
    if python is None:
        raise StationError("there is no python3 in PATH", REMEDIES["rclpy"])
    try:
        said = subprocess.run(
            [python, "-c", PROBE], env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            timeout=PROBE_S, check=True,
        )  # fmt: skip
        found = json.loads(said.stdout.splitlines()[-1])
    except subprocess.CalledProcessError as error:
        last = (error.stderr.strip().splitlines() or ["nothing"])[-1]
        raise StationError(f"{python}: ended with {error.returncode}: {last}", "is ROS 2 sourced and whole?") from error
    except (subprocess.TimeoutExpired, OSError, ValueError, IndexError) as error:
        raise StationError(f"{python}: does not answer as a Python does: {error}", "is ROS 2 sourced?") from error
    return {str(name): str(value) for name, value in found.items()}


class Lack(NamedTuple):
    """Something that is missing, and what to do about it."""

    what: str
    remedy: str


def missing(found: Mapping[str, str]) -> list[Lack]:
    """Of what probe() has found, what is not enough."""
    python = found["executable"]
    version = tuple(int(part) for part in found["python"].split(".")[:2])
    if version < OLDEST:
        return [
            Lack(f"{python} is Python {found['python']}", "the gateway needs 3.10 or later, which ROS 2 Humble has")
        ]
    lacking = [
        Lack(f"{python} has no {name}: {found[f'no {name}']}", remedy)
        for name, remedy in REMEDIES.items()
        if name not in found
    ]
    if found.get("captain_messages") == "without ROS":
        lacking.append(Lack(f"captain_messages of {python} was generated without --ros2", WHEEL))
    return lacking


def told(found: Mapping[str, str], lacking: list[Lack]) -> list[str]:
    """Lines of --check."""
    lines = [f"{'python3':22}{found['executable']}, {found['python']}"]
    for name in (*REMEDIES, *OPTIONAL):
        lines.append(f"{name:22}{found.get(name, 'no: ' + found.get(f'no {name}', ''))}")
    without = [name for name in OPTIONAL if name not in found]
    lines += [f"without {name}: {OPTIONAL[name]}" for name in without]
    if lacking:
        return lines + [f"missing: {lack.what}; {lack.remedy}" for lack in lacking]
    return [*lines, f"nothing is missing{' that it cannot do without' if without else ''}"]


def _station(place: tuple[str, int] | None) -> list[str]:
    """Parameters of the node that name a station."""
    if place is None:
        return []
    host, first = place
    ports = {"from_users": first, "to_users": first + 1, "pull": first + 2, "report": first + 3}
    words = ["-p", f"station.host:={host}"]
    return words + [word for name, port in ports.items() for word in ("-p", f"station.{name}:={port}")]
