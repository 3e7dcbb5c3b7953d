"""The gateway in a real ROS 2: built, between a played station and a node, under other names, and the lab test.

.venv/bin/python -m tests.proof.ros2.gateway --prefix DIR     with message packages that are installed in DIR
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from asn1.backends.ros2.model import RosPackage
from tests.proof.ros2 import codec, gateway_table, packages, ros, stations
from tests.proof.ros2.ros import RosError
from tests.proof.ros2.rows import Row

SOURCE = ros.ROOT / "firmware" / "gateway"
OWN = "captain_gateway_msgs"
FOLDERS = ros.INSIDE / "folders.cmake"
CAPTAIN = ros.ROOT / ".venv" / "bin" / "captain"
OTHER = ros.MADE / "other"  # where another definition of CAM is installed
WITH_ROS = ("node", "parameters", "own_topics", "diagnostics", "refusals", "topics", "endpoint")  # the last has zmq
MESSAGES = ("cam", "spatem", "mapem")  # of those that the library has; and a DENM of which something is left out
HEARD_S = 60.0
NO_PROGRAM = 127  # of a shell: what is called python3.10 is a script that has none
WHOLE_S, SHORT_S = 60.0, 5.0  # of the lab test: with all of its types, and with some
SLIP = "cam.recieve.max_age_s"  # a parameter that there is not
REFUSED = (
    ["--params-file", "/none.yaml"], ["-p", "handlers:=[cam, 3]"], ["-p", "handlers:=[cam, cam]"],
    ["-p", "topics.transmitted:='{type}/received'"], ["-r", "cam/transmitted:=cam/received"], ["-p", "cam.topic:=denm"],
    ["-p", "cam.topic:=1bad"], ["-p", "qos_overrides./cam/received.publisher.reliability:=nonsense"],
    ["-p", "qos_overrides./cam/received.publisher.depth:=-3"], ["-p", "qos_overrides./cam/received.publisher.depth:=x"],
    ["-p", "lists:=true"],
)  # fmt: skip
NAMES = {
    "etsi_its_conversion": (
        ["-r", "__node:=etsi_its_conversion"],
        ["/etsi_its_conversion/cam/out", "/etsi_its_conversion/denm/out"],
        ["/etsi_its_conversion/cam/in", "/etsi_its_conversion/denm/in"],
    ),
    "v2x_gw": (
        # Its profile needs a package that is not built here; the names are the same.
        [
            "-p",
            "profile:=etsi_its",
            "-p",
            "lists:=false",
            "-r",
            "__node:=v2x_gw",
            "-r",
            "/diagnostics:=/diagnostics/vehicle_captain",
        ],
        ["/cam/received", "/denm/received", "/diagnostics/vehicle_captain"],
        ["/cam/transmitted", "/denm/transmitted"],
    ),
    "captain_gateway": (
        ["-r", "__ns:=/car", "-r", "cam/received:=/v2x/cams", "-r", "/diagnostics:=/diagnostics/vehicle_captain"],
        ["/v2x/cams", "/car/denm/received", "/diagnostics/vehicle_captain"],
        ["/car/cam/transmitted", "/car/denm/transmitted"],
    ),
}


def run(made: list[RosPackage]) -> list[Row]:
    """A part of make ros2: with the packages that it has built; the lab test with those of its types that are there."""
    editions = [edition for package in made for edition in package.tops]
    if not set(packages.SHORT) <= set(editions) or made[0].profile != "etsi_its":
        return [Row("gateway", f"left out: it needs {' and '.join(packages.SHORT)} of etsi_its")]
    folder = codec.made(made)
    rows = build(ros.INSTALLED) + behave(folder, ros.INSTALLED) + names(folder, ros.INSTALLED)
    handlers = [name for name, edition in stations.TYPES.items() if edition in editions]
    duration_s = WHOLE_S if len(handlers) == len(stations.TYPES) else SHORT_S
    return rows + gateway_table.run(folder, ros.INSTALLED, duration_s, handlers)


def build(prefix: Path) -> list[Row]:
    """Both packages of the gateway by colcon, with what they need that no package index has."""
    rows = []
    for place, base in (
        (SOURCE / OWN, prefix),
        (SOURCE / "captain_gateway", prefix),
        (ros.INSIDE / "tf2_msgs", prefix),
        (ros.INSIDE / "other_cam", OTHER),
    ):
        rows.append(_built(place, base))
    program = prefix / "lib" / "captain_gateway" / "captain_gateway"
    config = prefix / "share" / "captain_gateway" / "config" / "v2x_gw.yaml"
    absent = [str(path) for path in (program, config) if not path.exists()]
    rows.append(_of_python("3.10"))
    rows.append(Row("captain_gateway installed", "program, parameter files", f"no {absent}" if absent else ""))
    return rows


def own_messages(prefix: Path) -> Row:
    """The gateway's own messages alone, for whoever runs it from its sources. Raises RosError."""
    return _built(SOURCE / OWN, prefix)


def _built(place: Path, base: Path) -> Row:
    began = time.monotonic()
    _colcon(place, base)
    return Row(f"{place.name} built", f"{time.monotonic() - began:.0f} s")


def _of_python(version: str) -> Row:
    """Whether the sources are for the Python of another ROS: those that need neither that nor zmq are imported."""
    python = shutil.which(f"python{version}")
    modules = [path.stem for path in (SOURCE / "captain_gateway" / "captain_gateway").glob("*.py")]
    pure = sorted(set(modules) - {"__init__", "__main__", *WITH_ROS})
    if python is None:
        return Row(f"Python {version}", "not here")
    command = [python, "-c", f"import {', '.join(f'captain_gateway.{name}' for name in pure)}"]
    environment = {"PYTHONPATH": str(SOURCE / "captain_gateway"), "PYTHONDONTWRITEBYTECODE": "1"}
    said = subprocess.run(command, env=environment, text=True, capture_output=True, check=False)
    if said.returncode == NO_PROGRAM:
        return Row(f"Python {version}", "not here")
    return Row(f"Python {version}", f"{len(pure)} modules imported", said.stderr[-300:])


def _colcon(place: Path, base: Path) -> None:
    """base: where it is installed; built beside."""
    work = ros.MADE / "gateway-build" / f"{place.name}-{base.name}"
    copied = work / "src" / place.name  # Python packages are built where they lie
    shutil.rmtree(copied, ignore_errors=True)
    shutil.copytree(place, copied)
    ros.run(
        [
            ros.ENV / "bin" / "colcon", "--log-base", work / "log", "build", "--merge-install", "--paths", copied,
            "--build-base", work / "build", "--install-base", base, "--cmake-args", "-GNinja", "-DBUILD_TESTING=OFF",
            "-DCMAKE_C_FLAGS=-O0", "-DCMAKE_CXX_FLAGS=-O0", f"-DCMAKE_PROJECT_INCLUDE={FOLDERS}",
            f"-DPython3_EXECUTABLE={ros.ENV / 'bin' / 'python'}",
        ],
        cwd=work, log=ros.MADE / f"{place.name}.log",
    )  # fmt: skip


def behave(folder: Path, prefix: Path) -> list[Row]:
    """Everything that may come by either way: tests/proof/ros2/inside/gateway.py."""
    path = ros.MADE / "gateway_behaviour.json"
    known = {message.name for message in stations.load(folder).all()}
    pdus = {name: stations.REAL[name].hex() for name in MESSAGES if stations.TYPES[name] in known}
    path.write_text(json.dumps(pdus | {"denm": stations.real.DENM.hex()}))
    with stations.played() as ports:
        words = [*stations.endpoint(ports), "-p", "qos_overrides./denm/received.publisher.reliability:=best_effort"]
        words += ["-p", f"{SLIP}:=1.0"]
        command = [CAPTAIN, "ros2", "--ros-args", *words]
        with stations.Node(command, stations.environment(folder, prefix), ros.MADE / "gateway.log") as node:
            arguments = [json.dumps(ports), path, *([OTHER] if OTHER.exists() else [])]
            said = stations.inside("gateway.py", *arguments, codec=folder, prefix=prefix)
        broken, is_named = "Traceback" in node.said, f"parameter {SLIP}: unknown" in node.said
    rows = [
        _checked(folder, prefix),
        *_refused(folder, prefix),
        *(Row(f"gateway: {what}", found, trouble) for what, found, trouble in said),
    ]
    rows.append(Row("gateway: a slip of the pen", SLIP, "" if is_named else "nobody was told"))
    return [*rows, Row("gateway: ends", "on SIGINT", f"with {node.said[-500:]}" if broken else "")]


def _checked(folder: Path, prefix: Path) -> Row:
    """What captain ros2 says of this ROS."""
    environment = stations.environment(folder, prefix)
    said = subprocess.run([CAPTAIN, "ros2", "--check"], env=environment, text=True, capture_output=True, check=False)
    last = (said.stdout.splitlines() or [said.stderr])[-1]
    return Row("captain ros2 --check", last, "" if said.returncode == 0 else said.stdout + said.stderr)


def _refused(folder: Path, prefix: Path) -> Iterator[Row]:
    """What ROS does not take ends the gateway in a line."""
    for words in REFUSED:
        with _gateway(folder, prefix, words) as node:
            _wait(lambda said=node: not said.is_running, f"{words} did not end it")
        said = "".join(node.said.splitlines()[-1:])  # behind what rcl may log
        is_told = said.startswith("captain_gateway: ") and "Traceback" not in node.said
        yield Row(f"gateway: {' '.join(words)}", said[:120], "" if is_told else f"said {node.said[-500:]}")


def names(folder: Path, prefix: Path) -> list[Row]:
    """Topics under the names of others, by a parameter file and by rules of ROS."""
    rows = []
    for name, (words, published, subscribed) in NAMES.items():
        file = SOURCE / "captain_gateway" / "config" / f"{name}.yaml"
        chosen = ["--params-file", str(file), *words]
        with stations.played() as ports, _gateway(folder, prefix, [*stations.endpoint(ports), *chosen]) as node:
            _wait(lambda said=node: "gateway to " in said.said, f"{name} did not start")
            found = stations.inside("topics.py", json.dumps(published + subscribed), codec=folder, prefix=prefix)
        wrong = [topic for topic in published if not found[topic][0]] + [t for t in subscribed if not found[t][1]]
        rows.append(
            Row(f"gateway: {name}.yaml", ", ".join(published + subscribed), f"nobody at {wrong}" if wrong else "")
        )
    return rows


def table(folder: Path, prefix: Path, duration_s: float) -> list[Row]:
    """The lab test with those of its types whose packages are built."""
    absent = [name for name in stations.TYPES if not _is_built(prefix, name)]
    return gateway_table.run(folder, prefix, duration_s, tuple(name for name in stations.TYPES if name not in absent))


def _is_built(prefix: Path, handler: str) -> bool:
    edition = stations.TYPES[handler]
    [package] = packages.profiles.packages(packages.SCHEMA, [packages.SCHEMA.messages[edition]], "etsi_its")
    return (prefix / "share" / package.name).exists()


def _gateway(folder: Path, prefix: Path, words: Iterable[str]) -> stations.Node:
    """As it is installed, where it is; else from the sources."""
    program = prefix / "lib" / "captain_gateway" / "captain_gateway"
    python = [str(ros.ENV / "bin" / "python"), "-m", "captain_gateway"]
    command = [str(program)] if os.access(program, os.X_OK) else python
    return stations.Node(
        [*command, "--ros-args", *words], stations.environment(folder, prefix), ros.MADE / "gateway.log"
    )


def _wait(holds: Callable[[], bool], words: str) -> None:
    ends = time.monotonic() + HEARD_S
    while not holds():
        if time.monotonic() > ends:
            raise RosError(words)
        time.sleep(0.1)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.proof.ros2.gateway", description=__doc__)
    parser.add_argument("--prefix", type=Path, default=ros.INSTALLED)
    parser.add_argument("--codec", type=Path, help="a message library with ROS; default: that of make ros2")
    parser.add_argument("--duration", type=float, default=60.0, help="of the lab test, in seconds")
    parser.add_argument("--only", action="append", choices=("build", "behave", "names", "table"))
    arguments = parser.parse_args()
    folder = arguments.codec or codec.made()
    parts: dict[str, Callable[[], list[Row]]] = {
        "build": lambda: build(arguments.prefix),
        "behave": lambda: behave(folder, arguments.prefix),
        "names": lambda: names(folder, arguments.prefix),
        "table": lambda: table(folder, arguments.prefix, arguments.duration),
    }
    rows = []
    for name in arguments.only or parts:
        found = parts[name]()
        print(*found, sep="\n", flush=True)
        rows += found
    return int(any(row.trouble for row in rows))


if __name__ == "__main__":
    sys.exit(main())
