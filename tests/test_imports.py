"""Imports of every file, compared with a table of permitted imports."""

import ast
import importlib.util
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.structure import LISTS, MOST_FILES, MOST_OF_A_FACE, OURS, Tree

ROOT = Path(__file__).resolve().parent.parent

STANDARD = sys.stdlib_module_names
DO_IO = frozenset({"os", "socket", "select", "selectors", "time", "threading", "subprocess", "asyncio"})
WORDS = ("drivers.message", "drivers.reason", "drivers.implausible")  # shared vocabulary of all parts


class Rule(NamedTuple):
    """Permitted imports of the files below a folder, in addition to the folder itself and the standard library.

    may    modules or packages; a package includes all its modules.
    never  modules that are forbidden, even from the standard library.
    """

    may: tuple[str, ...]
    never: frozenset[str] = frozenset()


GATEWAY = "firmware/gateway"  # no other folder may import it
CLIENT = "firmware/captain_client"  # a distribution of its own, whose root of imports is this folder

# The rule of the longest path that contains a file applies.
TABLE = {
    "board": Rule(("gpiod", "smbus2", "serial")),
    "board/runtime": Rule(()),
    "board/time": Rule(("board.runtime",)),
    "board/pi": Rule(("board.description",)),
    # paho and captain_messages are imported only in the process of the MQTT client.
    "drivers": Rule(
        ("board", "serial", "paho", "captain_messages"),
        frozenset({"board.slot", "board.supply", "board.health", "board.identity"}),
    ),
    "drivers/wire": Rule(("board.runtime.errors", "board.time", *WORDS), DO_IO),
    "drivers/sim": Rule(("board", "drivers.wire", *WORDS)),
    "pps": Rule(("board",)),
    # The station itself must not import its commands, nor code that draws or decodes.
    "firmware": Rule(
        ("board", "drivers", "pps", "zmq"),
        frozenset(
            f"firmware.{tools}"
            for tools in (
                "codec",
                "console",
                "doctor",
                "lab",
                "meter",
                "recordings",
                "replay",
                "swarm",
                "tap",
                "client",
            )
        ),
    ),
    # The configuration is also checked without a station: by `captain doctor` and the child process of a reload.
    "firmware/config": Rule(
        (
            "board",
            "drivers",
            "pps.chrony.feed",
            "firmware.clock.receivers",
            "firmware.routing.policy",
            "firmware.topics",
            "firmware.untrusted",
        )
    ),
    "firmware/codec": Rule(
        ("board", "drivers.wire", *WORDS, "firmware", "captain_messages"),
        frozenset({"firmware.doctor", "firmware.lab"}),
    ),
    "firmware/recordings": Rule(("board", "drivers.wire", *WORDS, "firmware.client.received")),
    # The console always runs. Without the libraries of users and stations, it takes half the memory.
    "firmware/console": Rule(
        ("board", "firmware"), frozenset({"firmware.doctor", "firmware.lab", "firmware.client.client"})
    ),
    # These folders run once, by commands of their own and without a station.
    "firmware/card": Rule(
        ("board", "drivers", "firmware", "yaml"),
        frozenset({"firmware.doctor", "firmware.lab", "firmware.client.client"}),
    ),
    "firmware/update": Rule(
        ("board", "firmware", "zmq"), frozenset({"firmware.doctor", "firmware.lab", "firmware.client.client"})
    ),
    "firmware/commands": Rule(("board", "drivers", "pps", "firmware", "zmq", "rich")),
    "firmware/client": Rule(
        ("board", "drivers.wire", *WORDS, "firmware", "zmq", "rich", "pygal", "captain_client"),
        frozenset({"firmware.doctor", "firmware.lab", "firmware.codec"}),
    ),
    "firmware/replay": Rule(("board", "drivers", "firmware", "zmq"), frozenset({"firmware.doctor", "firmware.lab"})),
    "firmware/swarm": Rule(("board", "drivers", "firmware", "zmq"), frozenset({"firmware.doctor", "firmware.lab"})),
    "firmware/doctor": Rule(("board", "drivers", "pps", "firmware", "zmq")),
    "firmware/lab": Rule(("board", "drivers", "pps", "firmware", "zmq", "rich")),
    "firmware/meter": Rule(("board", "drivers", "pps", "firmware", "zmq")),
    # The recorder is a process of its own. Only firmware/workers.py, where this process starts, imports it.
    "firmware/facilities": Rule(
        ("board", "drivers.wire", *WORDS, "firmware", "zmq"), frozenset({"firmware.doctor", "firmware.lab"})
    ),
    "firmware/recorder": Rule(
        ("board", "drivers.wire", *WORDS, "firmware", "zmq"), frozenset({"firmware.doctor", "firmware.lab"})
    ),
    "firmware/tap": Rule(("board", "drivers", "firmware", "rich"), frozenset({"firmware.doctor", "firmware.lab"})),
    # These ROS packages are installed without the rest of the project, so they must not import it.
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
    # Installed without the rest of the project.
    # Programs of users: they have only what pip installs.
    "firmware/guide/examples": Rule(("captain_client", "paho")),
    CLIENT: Rule(("zmq", "captain_messages", "captain_client")),
    "asn1": Rule(("asn1tools",)),
    "image": Rule(("board.runtime", "board.pi")),
    # Reads the parsers of all commands while packages are built.
    "image/manual": Rule(("firmware.cli", "shtab")),
}


def folder_of(path: Path) -> str:
    """Return the folder in TABLE that applies to a file; empty without such a row."""
    parents = [folder.as_posix() for folder in path.relative_to(ROOT).parents]
    return next((folder for folder in parents if folder in TABLE), "")


def imports(source: str, path: Path) -> set[str]:
    """Return all full names that a file imports, even inside functions; `from a import b` gives `a.b`."""
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
    """Return the imports of a file that the rule of its folder does not permit."""
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


STRUCTURE = Tree(ROOT)


def test_nothing_is_imported_past_the_face_of_a_package():
    assert STRUCTURE.past_a_face == []


def test_a_package_of_three_modules_tells_its_face():
    assert STRUCTURE.without_a_face == []


def test_a_line_of_a_face_or_of_commands_has_the_form_that_is_read():
    assert STRUCTURE.not_understood == []


def test_a_command_that_a_package_names_imports_what_is_inside_it():
    assert STRUCTURE.idle_commands == []


def test_a_package_imports_nothing_when_it_is_imported():
    assert STRUCTURE.not_empty == []


@pytest.mark.parametrize("package", STRUCTURE.faces)
def test_a_face_names_modules_that_are_there_and_not_too_many(package: str):
    assert len(STRUCTURE.faces[package]) <= MOST_OF_A_FACE
    assert STRUCTURE.faces[package] <= set(STRUCTURE.modules)


def test_no_module_needs_itself_by_way_of_others():
    assert STRUCTURE.cycles(is_lazy=True) == []


def test_a_folder_has_no_more_files_than_a_newcomer_can_read():
    assert {
        folder: count for folder, count in STRUCTURE.files.items() if count > MOST_FILES and folder not in LISTS
    } == {}


def test_a_class_name_occurs_at_most_three_times():
    assert STRUCTURE.names == {}


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
        ("board/runtime/x.py", "from board.line import Line"),
        ("board/x.py", "def late():\n    import firmware.cli"),
        ("drivers/x.py", "import zmq"),
        ("drivers/x.py", "import firmware"),
        ("drivers/x.py", "from pps import timemark"),
        ("drivers/x.py", "from board import slot"),
        ("drivers/x.py", "from board.slot import SlotSequencer"),
        ("drivers/x.py", "from ..firmware import routing"),
        ("drivers/wire/x.py", "import os.path"),
        ("drivers/wire/x.py", "from socket import AF_INET"),
        ("drivers/wire/x.py", "import time"),
        ("drivers/wire/x.py", "from board.runtime import loop"),
        ("drivers/wire/x.py", "from board.runtime.loop import Loop"),
        ("drivers/wire/x.py", "from drivers.contract import Host"),
        ("drivers/wire/x.py", "from .. import contract"),
        ("drivers/sim/x.py", "from drivers.udp.driver import Udp"),
        ("drivers/sim/x.py", "from drivers import DRIVERS"),
        ("firmware/x.py", "import rclpy"),
        ("firmware/gateway/x.py", "from firmware import topics"),
        ("firmware/gateway/x.py", "from board.runtime.errors import StationError"),
        ("firmware/commands/x.py", "from firmware.gateway import captain_gateway"),
        ("firmware/captain_client/captain_client/x.py", "from board.runtime.errors import StationError"),
        ("firmware/captain_client/captain_client/x.py", "from firmware import topics"),
        ("firmware/x.py", "import captain_client"),
        ("firmware/recorder/x.py", "import captain_client"),
        ("firmware/x.py", "import asn1"),
        ("firmware/x.py", "from firmware.codec import library"),
        ("firmware/config/x.py", "from firmware.station import supervisor"),
        ("firmware/codec/x.py", "import asn1"),
        ("firmware/client/x.py", "from firmware.codec import library"),
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
        ("drivers/x.py", "from board.runtime.loop import Loop\nfrom .wire import btp\nimport serial.tools"),
        ("drivers/wire/x.py", "import struct\nfrom board.time.scales import Fix\nfrom .. import message"),
        ("drivers/sim/x.py", "import socket\nfrom drivers.wire.geonet.protocol import GeoNetworking"),
        ("firmware/gateway/x.py", "import rclpy.node"),
        (
            "firmware/captain_client/captain_client/x.py",
            "import zmq.asyncio\nfrom captain_client.errors import StationError",
        ),
    ],
)
def test_an_import_within_the_table_is_allowed(path: str, source: str):
    assert offences(source, ROOT / path) == []


@pytest.mark.parametrize("name", OURS)
def test_the_name_of_a_package_of_ours_means_ours_and_not_one_from_the_package_index(name: str):
    # The package index has packages `board` and `asn1` too. If installed, they must not take precedence over ours.
    spec = importlib.util.find_spec(name)
    assert spec is not None
    assert set(spec.submodule_search_locations or ()) == {str(ROOT / name)}
