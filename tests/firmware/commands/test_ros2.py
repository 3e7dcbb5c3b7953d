"""captain ros2: which Python runs the gateway, and what is said where something is missing there."""

import json
import os
import sys
from pathlib import Path

import pytest

from board.runtime.errors import StationError
from firmware import cli
from firmware.commands import ros2

WHOLE = {
    "python": "3.12.3", "executable": "/usr/bin/python3", "rclpy": "/opt/ros/rclpy", "zmq": "/usr/zmq",
    "captain_messages": "/site/captain_messages.abi3.so", "captain_gateway": "/ws/captain_gateway",
    "captain_gateway_msgs": "/ws/captain_gateway_msgs", "messages": "etsi_its_cam_msgs, etsi_its_denm_msgs",
    "diagnostic_msgs": "/opt/ros/d", "geometry_msgs": "/opt/ros/g", "sensor_msgs": "/opt/ros/s", "tf2_msgs": "/opt/ros/t",
}  # fmt: skip


def without(*names: str) -> dict[str, str]:
    rest = {name: value for name, value in WHOLE.items() if name not in names}
    return rest | {f"no {name}": f"ModuleNotFoundError: No module named '{name}'" for name in names}


@pytest.fixture
def python(tmp_path, monkeypatch):
    """A python3 in PATH that answers as is written, and notes how it is run otherwise."""
    program = tmp_path / "python3"

    def answers(found: dict[str, str], code: int = 0) -> Path:
        says = json.dumps(found | {"executable": str(program)})
        program.write_text(
            f"#!{sys.executable}\nimport json, os, sys\n"
            f"if sys.argv[1] == '-c':\n    print('a ROS may print')\n    print({says!r})\n    sys.exit({code})\n"
            f"print(json.dumps([sys.argv[1:], dict(os.environ)]))\n"
        )
        program.chmod(0o755)
        return program

    monkeypatch.setenv("PATH", str(tmp_path))
    return answers


def test_nothing_is_missing_where_all_is_there():
    assert ros2.missing(WHOLE) == []
    assert ros2.told(WHOLE, [])[-1] == "nothing is missing"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("rclpy", "source a ROS 2: . /opt/ros/jazzy/setup.bash"),
        ("zmq", "apt-get install python3-zmq"),
        ("captain_messages", "captain-asn1 generate --all --format wheel --ros2"),
        ("captain_gateway", "colcon build"),
        ("diagnostic_msgs", "ros-jazzy-common-interfaces"),
        ("geometry_msgs", "apt-get install ros-<distribution>-common-interfaces"),
        ("sensor_msgs", "ros-jazzy-common-interfaces"),
        ("messages", "captain-asn1 generate cam-1.4.1 denm-1.3.1 --format ros2"),
    ],
)
def test_what_is_missing_is_named_with_how_to_get_it(name, words):
    [lack] = ros2.missing(without(name))
    assert f"has no {name}: ModuleNotFoundError" in lack.what
    assert words in lack.remedy


def test_what_the_other_python_has_is_found_by_asking_it(tmp_path, monkeypatch):
    for name in (
        "etsi_its_cam_msgs", "v2x_msgs", "captain_srem_2_1_1_msgs", "captain_v2x_cam_2_3_1_msgs", "captain_gateway_msgs",
        "etsi_its_conversion", "std_msgs", "diagnostic_msgs",
    ):  # fmt: skip
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").touch()
    (tmp_path / "diagnostic_msgs" / "msg.py").touch()
    (tmp_path / "python3").symlink_to(sys.executable)
    found = ros2.probe({"PATH": str(tmp_path), "PYTHONPATH": str(tmp_path)})
    assert found["messages"] == "captain_srem_2_1_1_msgs, captain_v2x_cam_2_3_1_msgs, etsi_its_cam_msgs, v2x_msgs"
    assert found["diagnostic_msgs"] == str(tmp_path / "diagnostic_msgs" / "msg.py")
    assert "no sensor_msgs" in found


def test_a_message_library_without_ros_is_as_good_as_none():
    [lack] = ros2.missing(WHOLE | {"captain_messages": "without ROS"})
    assert "generated without --ros2" in lack.what


def test_an_old_python_is_told_before_what_it_lacks():
    [lack] = ros2.missing(without("rclpy") | {"python": "3.8.10"})
    assert "3.10 or later" in lack.remedy


@pytest.mark.parametrize(("name", "words"), [("captain_gateway_msgs", "no services"), ("tf2_msgs", "not on /tf")])
def test_gateway_without_an_optional_package_runs_and_names_what_it_lacks(name, words):
    found = without(name)
    assert ros2.missing(found) == []
    *_, said, last = ros2.told(found, [])
    assert said.startswith(f"without {name}: ")
    assert words in said
    assert "nothing is missing" in last


def test_the_sources_beside_this_program_come_behind_what_is_installed():
    place = ros2.sources()
    assert place is not None
    assert ros2.with_sources({"PYTHONPATH": "/ws"}, place)["PYTHONPATH"] == f"/ws:{place}"
    assert ros2.with_sources({}, place)["PYTHONPATH"] == str(place)
    assert ros2.with_sources({"PYTHONPATH": "/ws"}, None) == {"PYTHONPATH": "/ws"}


def test_a_machine_without_ros_is_told_in_words(python, capsys):
    python(without("rclpy", "captain_messages"))
    assert cli.main(["ros2"]) == 1
    said = capsys.readouterr().err
    assert "has no rclpy" in said
    assert "(and 1 more: captain ros2 --check)" in said
    assert "source a ROS 2" in said
    assert "Traceback" not in said


def test_a_path_without_python_is_told_in_words(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    assert cli.main(["ros2"]) == 1
    assert "python3: not found in PATH" in capsys.readouterr().err


def test_a_python_that_breaks_is_told_in_words(python):
    python(WHOLE, code=3)
    with pytest.raises(StationError, match="ended with 3"):
        ros2.probe(os.environ)


def test_check_shows_what_there_is_and_starts_nothing(python, capsys):
    python(without("rclpy"))
    assert cli.main(["ros2", "--check"]) == 1
    said = capsys.readouterr().out
    assert "rclpy                 no: ModuleNotFoundError" in said
    assert "missing: " in said
    python(WHOLE)
    assert cli.main(["ros2", "--check"]) == 0


class ReplacedError(BaseException):
    """execve(2) does not come back."""


def replacing(note):
    def execve(*given: object) -> None:
        note(*given)
        raise ReplacedError

    return execve


def test_the_node_takes_the_place_of_the_command_with_the_arguments_of_ros(python, monkeypatch):
    program = python(WHOLE)
    ran: list[tuple[str, list[str], dict[str, str]]] = []
    monkeypatch.setattr(os, "execve", replacing(lambda *given: ran.append(given)))
    with pytest.raises(ReplacedError):
        cli.main(["ros2", "--station", "10.0.0.7:6000", "--ros-args", "-p", "profile:=v2x_msgs", "-r", "__ns:=/car"])
    [(path, words, _)] = ran
    assert path == str(program)
    assert words[1:4] == ["-m", "captain_gateway", "--ros-args"]
    assert "station.host:=10.0.0.7" in words
    assert "station.report:=6003" in words
    assert words[-4:] == ["-p", "profile:=v2x_msgs", "-r", "__ns:=/car"]


def test_a_frozen_program_takes_its_libraries_out_of_the_way(python, monkeypatch):
    python(WHOLE)
    ran: list[dict[str, str]] = []
    monkeypatch.setattr(os, "execve", replacing(lambda path, words, environment: ran.append(dict(environment))))
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setenv("LD_LIBRARY_PATH", "/tmp/_MEI123")
    monkeypatch.setenv("LD_LIBRARY_PATH_ORIG", "/opt/ros/jazzy/lib")
    monkeypatch.setenv("_PYI_ARCHIVE_FILE", "captain")
    with pytest.raises(ReplacedError):
        cli.main(["ros2"])
    [environment] = ran
    assert environment["LD_LIBRARY_PATH"] == "/opt/ros/jazzy/lib"
    assert "_PYI_ARCHIVE_FILE" not in environment
