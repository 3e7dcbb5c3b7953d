"""Package files of the gateway: consistent, and valid for Python 3.10."""

import ast
import re
import tomllib
from pathlib import Path

import pytest
import yaml

from firmware.gateway.captain_gateway.captain_gateway import VERSION
from firmware.gateway.captain_gateway.captain_gateway.handlers import KINDS
from firmware.gateway.captain_gateway.captain_gateway.settings import GATEWAY, HANDLER

ROOT = Path(__file__).parents[3] / "firmware" / "gateway"
NODE = ROOT / "captain_gateway"
SOURCES = sorted(NODE.rglob("*.py"))
NOT_BEFORE_3_11 = {
    "tomllib",
    "typing.Self",
    "typing.assert_never",
    "enum.StrEnum",
    "datetime.UTC",
    "typing.override",
    "itertools.batched",
}


def test_versions_agree():
    said = re.findall(r"<version>(.*)</version>", "".join(path.read_text() for path in ROOT.rglob("package.xml")))
    said += re.findall(r'version="(.*)"', (NODE / "setup.py").read_text())
    assert set(said) == {VERSION}
    assert len(said) == 3


@pytest.mark.parametrize("name", [*GATEWAY, *(f"<type>.{name}" for name in HANDLER)])
def test_every_parameter_is_described(name):
    text = (ROOT / "README.md").read_text()
    short = "." + name.rpartition(".")[2]
    assert f"`{name}`" in text or (name.startswith("<type>.transmit.") and f"`{short}`" in text)


@pytest.mark.parametrize("path", sorted((NODE / "config").glob("*.yaml")), ids=lambda path: path.name)
def test_every_parameter_file_says_what_there_is(path):
    values = yaml.safe_load(path.read_text())["/**"]["ros__parameters"]
    overrides = values.pop("qos_overrides", {})
    for name, value in values.items():
        head, _, rest = name.partition(".")
        option = GATEWAY.get(name) or (HANDLER[rest] if head in KINDS else None)
        assert option is not None, name
        option.read(value)
    for topic, ends in overrides.items():
        assert topic.startswith("/")
        assert set(ends) <= {"publisher", "subscription"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(NODE)))
def test_a_source_is_for_python_3_10(path):
    tree = ast.parse(path.read_text(), feature_version=(3, 10))
    names = {
        f"{node.module}.{one.name}" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for one in node.names
    }
    names |= {one.name for node in ast.walk(tree) if isinstance(node, ast.Import) for one in node.names}
    assert names & NOT_BEFORE_3_11 == set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):  # a NamedTuple is generic since 3.11
            assert len(node.bases) < 2 or "NamedTuple" not in map(ast.unparse, node.bases), node.name
        # int.to_bytes and int.from_bytes have a default order of octets since 3.11.
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr in ("to_bytes", "from_bytes")
        ):
            assert len(node.args) == 2, f"line {node.lineno}"


def test_all_of_the_package_is_installed():
    text = (NODE / "setup.py").read_text()
    folders = {
        path.parent.relative_to(NODE / "captain_gateway").as_posix()
        for path in (NODE / "captain_gateway").rglob("*.py")
    }
    assert folders == {".", "handlers"}
    assert 'packages=[NAME, f"{NAME}.handlers"]' in text


def test_nothing_of_it_is_packed_with_the_station():
    data = tomllib.loads((ROOT.parents[1] / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    assert not any("gateway" in pattern for patterns in data.values() for pattern in patterns)


def test_every_message_of_its_own_is_built():
    made = re.findall(
        r"^  ((?:msg|srv)/\w+\.\w+)$", (ROOT / "captain_gateway_msgs" / "CMakeLists.txt").read_text(), re.MULTILINE
    )
    there = [
        path.relative_to(ROOT / "captain_gateway_msgs").as_posix()
        for path in ROOT.rglob("*.*")
        if path.suffix in (".msg", ".srv")
    ]
    assert sorted(made) == sorted(there)


ROS = {
    "rclpy", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "rcl_interfaces", "sensor_msgs", "tf2_msgs",
    "captain_gateway_msgs", "launch", "launch_ros",
}  # fmt: skip


def test_every_package_of_ros_that_is_imported_is_a_dependency():
    named = set(re.findall(r"<exec_depend>(.*)</exec_depend>", (NODE / "package.xml").read_text()))
    assert {
        name.partition(".")[0]
        for path in SOURCES
        for one in ast.walk(ast.parse(path.read_text()))
        for name in ([one.module or ""] if isinstance(one, ast.ImportFrom) else [])
        + ([alias.name for alias in one.names] if isinstance(one, ast.Import) else [])
        if name.partition(".")[0] in ROS
    } == ROS
    assert named - {"python3-zmq"} == ROS
