"""Who may import whom: the imports of every file are read, and each has to be in the table."""

import ast
import importlib.util
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parent.parent

STANDARD = sys.stdlib_module_names
OURS = ("asn1", "board", "drivers", "firmware", "image", "pps")
DO_IO = frozenset({"os", "socket", "select", "selectors", "time", "threading", "subprocess", "asyncio"})
WORDS = ("drivers.message", "drivers.reason", "drivers.implausible")  # what travels, why it did not, why it is doubted


class Rule(NamedTuple):
    """What the files below a folder may import beside themselves and the standard library.

    may    modules or packages; a package stands for all that it holds.
    never  exceptions from that, the standard library included.
    """

    may: tuple[str, ...]
    never: frozenset[str] = frozenset()


GATEWAY = "firmware/gateway"  # imported by nothing

# The longest folder that holds a file decides.
TABLE = {
    "board": Rule(("gpiod", "smbus2", "serial")),
    # The last two only in the process of the MQTT client.
    "drivers": Rule(
        ("board", "serial", "paho", "captain_messages"),
        frozenset({"board.slot", "board.supply", "board.health", "board.identity"}),
    ),
    "drivers/wire": Rule(("board.errors", "board.time", *WORDS), DO_IO),
    "drivers/sim": Rule(("board", "drivers.wire", *WORDS)),
    "pps": Rule(("board",)),
    # The station itself knows nothing of its commands, and draws and decodes nothing.
    "firmware": Rule(
        ("board", "drivers", "pps", "zmq"),
        frozenset(
            f"firmware.{tools}" for tools in ("codec", "console", "lab", "meter", "replay", "swarm", "tap", "user")
        ),
    ),
    "firmware/codec": Rule(
        ("board", "drivers.wire", *WORDS, "firmware", "captain_messages"), frozenset({"firmware.lab"})
    ),
    # It runs for as long as the machine does: without the libraries of users and stations, it takes half the memory.
    "firmware/console": Rule(("board", "firmware"), frozenset({"firmware.lab", "firmware.user.client"})),
    # Run by its own command once, before the station is there.
    "firmware/box": Rule(("board", "drivers", "firmware", "yaml"), frozenset({"firmware.lab", "firmware.user.client"})),
    "firmware/commands": Rule(("board", "drivers", "pps", "firmware", "zmq", "rich")),
    "firmware/user": Rule(
        ("board", "drivers.wire", *WORDS, "firmware", "zmq", "rich", "pygal"),
        frozenset({"firmware.lab", "firmware.codec"}),
    ),
    "firmware/replay": Rule(("board", "drivers", "firmware", "zmq"), frozenset({"firmware.lab"})),
    "firmware/swarm": Rule(("board", "drivers", "firmware", "zmq"), frozenset({"firmware.lab"})),
    "firmware/lab": Rule(("board", "drivers", "pps", "firmware", "zmq", "rich")),
    "firmware/meter": Rule(("board", "drivers", "pps", "firmware", "zmq")),
    # The station starts it as a process of its own; only firmware/workers.py, which that process begins with, names it.
    "firmware/recorder": Rule(("board", "drivers.wire", *WORDS, "firmware", "zmq"), frozenset({"firmware.lab"})),
    "firmware/tap": Rule(("board", "drivers", "firmware", "rich", "paho"), frozenset({"firmware.lab"})),
    # ROS packages, installed where ROS is: nothing else of ours is there.
    GATEWAY: Rule(
        (
            "zmq",
            "captain_messages",
            "rclpy",
            "builtin_interfaces",
            "captain_gateway_msgs",
            "diagnostic_msgs",
            "geometry_msgs",
            "rcl_interfaces",
            "sensor_msgs",
            "tf2_msgs",
            "launch",
            "launch_ros",
            "setuptools",
        )
    ),
    "asn1": Rule(("asn1tools",)),
    "image": Rule(()),
}


def folder_of(path: Path) -> str:
    """The row of the table for a file, or nothing."""
    parents = [folder.as_posix() for folder in path.relative_to(ROOT).parents]
    return next((folder for folder in parents if folder in TABLE), "")


def imports(source: str, path: Path) -> set[str]:
    """The full names that a file imports, wherever in it, with `from a import b` as `a.b`."""
    package = path.relative_to(ROOT).parent.parts
    found: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else ()
            module = ".".join([*base, *([node.module] if node.module else [])])
            found |= {f"{module}.{name.name}" for name in node.names}
    return found


def is_within(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


def offences(source: str, path: Path) -> list[str]:
    """The imports of a file that its folder does not allow."""
    folder = folder_of(path)
    rule = TABLE[folder]
    allowed = (folder.replace("/", "."), *rule.may)
    return sorted(
        name
        for name in imports(source, path)
        if any(is_within(name, word) for word in rule.never)
        or (is_within(name, GATEWAY.replace("/", ".")) and folder != GATEWAY)
        or not (name.split(".")[0] in STANDARD or any(is_within(name, package) for package in allowed))
    )


FILES = sorted(path for folder in OURS for path in (ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_imports_only_what_its_folder_may(path: Path):
    assert folder_of(path), "its folder is not in the table"
    assert offences(path.read_text(), path) == []


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("board/x.py", "import drivers"),
        ("board/x.py", "from drivers.message import Request"),
        ("board/x.py", "import zmq"),
        ("board/x.py", "def late():\n    import firmware.app"),
        ("drivers/x.py", "import zmq"),
        ("drivers/x.py", "import firmware"),
        ("drivers/x.py", "from pps import timemark"),
        ("drivers/x.py", "from board import slot"),
        ("drivers/x.py", "from board.slot import Slot"),
        ("drivers/x.py", "from ..firmware import router"),
        ("drivers/wire/x.py", "import os.path"),
        ("drivers/wire/x.py", "from socket import AF_INET"),
        ("drivers/wire/x.py", "import time"),
        ("drivers/wire/x.py", "from board import loop"),
        ("drivers/wire/x.py", "from board.loop import Loop"),
        ("drivers/wire/x.py", "from drivers.contract import Host"),
        ("drivers/wire/x.py", "from .. import contract"),
        ("drivers/sim/x.py", "from drivers.udp import Udp"),
        ("drivers/sim/x.py", "from drivers import DRIVERS"),
        ("firmware/x.py", "import rclpy"),
        ("firmware/gateway/x.py", "from firmware import topics"),
        ("firmware/gateway/x.py", "from board.errors import StationError"),
        ("firmware/commands/x.py", "from firmware.gateway import captain_gateway"),
        ("firmware/x.py", "import asn1"),
        ("firmware/x.py", "from firmware.codec import library"),
        ("firmware/codec/x.py", "import asn1"),
        ("firmware/user/x.py", "from firmware.codec import library"),
        ("firmware/commands/x.py", "import captain_messages"),
        ("firmware/commands/x.py", "import numpy"),
        ("pps/x.py", "from drivers.contract import Can"),
        ("image/x.py", "import board"),
        ("asn1/x.py", "from firmware import VERSION"),
        ("asn1/x.py", "import rich"),
        ("asn1/x.py", "from pycrate_asn1c import asnproc"),
    ],
)
def test_an_import_against_the_table_is_found(path: str, source: str):
    assert offences(source, ROOT / path)


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("board/x.py", "import os, gpiod\nfrom board import loop\nfrom . import errors"),
        ("drivers/x.py", "from board.loop import Loop\nfrom .wire import btp\nimport serial.tools"),
        ("drivers/wire/x.py", "import struct\nfrom board.time import Fix\nfrom .. import message"),
        ("drivers/sim/x.py", "import socket\nfrom drivers.wire.geonet import GeoNetworking"),
        ("firmware/gateway/x.py", "import rclpy.node"),
    ],
)
def test_an_import_within_the_table_is_allowed(path: str, source: str):
    assert offences(source, ROOT / path) == []


@pytest.mark.parametrize("name", OURS)
def test_the_name_of_a_package_of_ours_means_ours_and_not_one_from_the_package_index(name: str):
    # `board` and `asn1` are also names there; an installed one must not come first.
    spec = importlib.util.find_spec(name)
    assert spec is not None
    assert set(spec.submodule_search_locations or ()) == {str(ROOT / name)}
