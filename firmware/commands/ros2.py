"""captain ros2: starts the gateway to ROS 2, by the Python of the sourced ROS."""

import argparse
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from board.runtime import tool
from board.runtime.errors import StationError
from firmware.client.arguments import station
from firmware.printable import folded

DESCRIPTION = """\
Starts the gateway between a station and ROS 2. It is a node, captain_gateway,
with topics for received messages and for messages to send. It runs on this
machine, with the ROS 2 that is sourced. The station may be on another machine.

The python3 of that ROS 2 needs rclpy, the common interfaces and pyzmq. It also
needs the wheel of captain_messages, captain_gateway (built by colcon, or in
this checkout), and a package of messages. Missing parts are listed by --check,
each with its remedy.
"""
EPILOG = """\
examples:
  captain ros2                              a station of this machine
  captain ros2 --station 10.0.0.7           one elsewhere on the network
  captain ros2 --check                      installed and missing parts
  captain ros2 --ros-args -p profile:=v2x_msgs -r __ns:=/car
                                            arguments after --ros-args are
                                            those of ROS

exit codes:
  0    ended by Ctrl-C; with --check: nothing is missing
  1    something is missing
  2    wrong usage
"""
PROBE_S = 30.0
# This is run by the other Python. Its answer is the last line, because a ROS may print text while it is imported.
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
# Debian 12 and Ubuntu 24.04 refuse pip without this option (PEP 668); it does no harm there.
PIP = "python3 -m pip install (where that is refused as externally managed: with --user --break-system-packages)"
WHEEL = f"captain-asn1 generate --all --format wheel --ros2 --to DIR, then {PIP} DIR/*.whl"
COMMON = (
    "apt-get install ros-<distribution>-common-interfaces, or beside the wheel of rclpy python3 -m pip install "
    "ros-jazzy-common-interfaces"
)
REMEDIES = {
    "rclpy": "source a ROS 2: . /opt/ros/jazzy/setup.bash; to install one: https://docs.ros.org, or, to "
    "try it, python3 -m pip install 'ros-jazzy-rclpy[fastrtps]' ros-jazzy-common-interfaces (x86-64, Python 3.11 "
    "and 3.12)",
    "zmq": f"apt-get install python3-zmq, or {PIP} pyzmq",
    "captain_messages": WHEEL,
    "captain_gateway": "copy firmware/gateway of captain's sources into the src of a colcon workspace, colcon build, "
    "and source its install/setup.bash",
    "diagnostic_msgs": COMMON,
    "geometry_msgs": COMMON,
    "sensor_msgs": COMMON,
    "messages": "captain-asn1 generate cam-1.4.1 denm-1.3.1 --format ros2 --to DIR, build them by colcon, and source "
    "their setup file",
}
# Optional parts of ROS -> functions that are missing without them.
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
    parser.add_argument("--check", action="store_true", help="list installed and missing parts, start nothing")
    parser.add_argument("--ros-args", nargs=argparse.REMAINDER, default=[], help="arguments of ROS: all that follow")


def main(arguments: argparse.Namespace) -> int:
    """Replace this process by the ROS 2 gateway. Raises StationError for the first missing part of ROS 2."""
    environment = with_sources(tool.environment() or os.environ, sources())
    found = probe(environment)
    lacking = missing(found)
    if arguments.check:
        print(folded("\n".join(told(found, lacking)), sys.stdout))
        return 1 if lacking else 0
    if lacking:
        first, *others = lacking
        more = f" (and {len(others)} more: captain ros2 --check)" if others else ""
        raise StationError(first.what + more, first.remedy)
    command = [found["executable"], "-m", "captain_gateway", "--ros-args", *_station(arguments.station)]
    return os.execve(command[0], [*command, *arguments.ros_args], environment)


def sources() -> Path | None:
    """Return the folder of the gateway beside this program's sources; None in a binary, which does not contain it."""
    place = Path(__file__).resolve().parents[1] / "gateway" / "captain_gateway"
    return place if (place / "captain_gateway" / "__init__.py").is_file() else None


def with_sources(environment: Mapping[str, str], place: Path | None) -> dict[str, str]:
    """Return the environment with the gateway's sources last in PYTHONPATH: an installed gateway is preferred."""
    if place is None:
        return dict(environment)
    before = environment.get("PYTHONPATH", "")
    return {**environment, "PYTHONPATH": f"{before}:{place}" if before else str(place)}


def probe(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the modules that the python3 of an environment has: module -> path, or "no <module>" -> reason.

    Raises StationError if python3 is missing, fails, or answers otherwise.
    """
    python = shutil.which("python3", path=environment.get("PATH"))
    if python is None:
        raise StationError("python3: not found in PATH", REMEDIES["rclpy"])
    try:
        said = subprocess.run(
            [python, "-c", PROBE], env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True,
            timeout=PROBE_S, check=True,
        )  # fmt: skip
        found = json.loads(said.stdout.splitlines()[-1])
    except subprocess.CalledProcessError as error:
        last = (error.stderr.strip().splitlines() or ["nothing"])[-1]
        raise StationError(f"{python}: ended with {error.returncode}: {last}", "source a complete ROS 2") from error
    except (subprocess.TimeoutExpired, OSError, ValueError, IndexError) as error:
        raise StationError(f"{python}: does not answer as a Python does: {error}", "source ROS 2") from error
    return {str(name): str(value) for name, value in found.items()}


class Lack(NamedTuple):
    """Missing part, with its remedy."""

    what: str
    remedy: str


def missing(found: Mapping[str, str]) -> list[Lack]:
    """Return the missing parts by the result of probe()."""
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
    """Return the lines that --check prints."""
    lines = [f"{'python3':22}{found['executable']}, {found['python']}"]
    for name in (*REMEDIES, *OPTIONAL):
        lines.append(f"{name:22}{found.get(name, 'no: ' + found.get(f'no {name}', ''))}")
    without = [name for name in OPTIONAL if name not in found]
    lines += [f"without {name}: {OPTIONAL[name]}" for name in without]
    if lacking:
        return lines + [f"missing: {lack.what}; {lack.remedy}" for lack in lacking]
    return [*lines, f"nothing is missing{' that it cannot do without' if without else ''}"]


def _station(place: tuple[str, int] | None) -> list[str]:
    """Return the node's parameters that name a station."""
    if place is None:
        return []
    host, first = place
    ports = {"from_users": first, "to_users": first + 1, "pull": first + 2, "report": first + 3}
    words = ["-p", f"station.host:={host}"]
    return words + [word for name, port in ports.items() for word in ("-p", f"station.{name}:={port}")]
