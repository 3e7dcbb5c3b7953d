"""Files of a ROS 2 package: .msg, colcon, Debian."""

import subprocess
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from asn1.__main__ import main
from asn1.backends.backend import Job
from asn1.backends.registry import BACKENDS
from asn1.backends.ros2 import package, profile_etsi_its
from asn1.backends.ros2.msg import text as msg_text
from asn1.backends.ros2.options import PROFILES, Ros2Options
from asn1.model import text
from tests.said import tells

SCHEMA = text.load_schema()
ROOT = Path(__file__).resolve().parents[4]


@pytest.fixture
def written(tmp_path):
    BACKENDS["ros2"].write(Job(SCHEMA, ("cam-1.4.1",)), tmp_path / "ros2", lambda name: None)
    return tmp_path / "ros2" / "etsi_its_cam_msgs"


def msg(edition, name):
    made = profile_etsi_its.package(SCHEMA, SCHEMA.messages[edition])
    return msg_text(SCHEMA, made, made.messages[name])


def test_a_message_says_where_it_is_written_and_its_range_and_unit():
    assert msg("cam-1.4.1", "SpeedValue") == (
        "# etsi_its_cam_msgs/SpeedValue: SpeedValue of ETSI TS 102 894-2 v1.3.1\n\n"
        "# 0..16383; unit 0.01 m/s\n"
        "uint16 value\n"
        "uint16 MIN = 0\n"
        "uint16 MAX = 16383\n"
        "uint16 STANDSTILL = 0\n"
        "uint16 ONE_CENTIMETER_PER_SEC = 1\n"
        "uint16 UNAVAILABLE = 16383\n"
    )


def test_message_without_a_component_of_the_standard_names_it():
    (line,) = (line for line in msg("mapem-2.1.1", "MapData").splitlines() if line.startswith("# not "))
    assert tells(line, "standard: ", "regional")


def test_a_default_is_said():
    assert "; default 600\n" in msg("denm-1.3.1", "ManagementContainer")


def test_the_package_names_itself_its_licence_and_every_message(written):
    document = ET.parse(written / "package.xml").getroot()
    assert document.findtext("name") == "etsi_its_cam_msgs"
    assert document.findtext("license") == "Apache-2.0"
    assert document.findtext("member_of_group") == "rosidl_interface_packages"
    named = [line.strip(' "') for line in (written / "CMakeLists.txt").read_text().splitlines() if ".msg" in line]
    assert named == sorted(f"msg/{path.name}" for path in (written / "msg").iterdir())


def test_a_package_that_takes_messages_of_others_depends_on_them(tmp_path):
    job = Job(SCHEMA, ("cam-1.4.1",), Ros2Options(profile="v2x_msgs"))
    BACKENDS["ros2"].write(job, tmp_path / "ros2", lambda name: None)
    assert "<depend>std_msgs</depend>" in (tmp_path / "ros2/v2x_msgs/package.xml").read_text()
    assert "DEPENDENCIES std_msgs" in (tmp_path / "ros2/v2x_msgs/CMakeLists.txt").read_text()
    assert "ros-jazzy-std-msgs" in (tmp_path / "ros2/v2x_msgs/debian/control").read_text()


def test_the_licence_is_that_of_the_project():
    assert (package.TEMPLATE / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()


def test_debians_tools_make_a_source_package_of_it(written):
    subprocess.run(["dpkg-source", "-b", written.name], cwd=written.parent, check=True, capture_output=True)
    [described] = written.parent.glob("ros-jazzy-etsi-its-cam-msgs_*.dsc")
    assert "Binary: ros-jazzy-etsi-its-cam-msgs" in described.read_text()


def test_functions_in_si_units_are_a_debian_package_of_every_architecture(written):
    folder = written.parent / "captain_si"
    subprocess.run(["dpkg-source", "-b", folder.name], cwd=folder.parent, check=True, capture_output=True)
    control = (folder / "debian" / "control").read_text()
    assert "\nArchitecture: all\nDepends: ${misc:Depends}\n" in control


def test_the_command_writes_packages_and_says_how_to_build_them(tmp_path, capsys):
    line = ["generate", "cam-2.3.1", "mapem", "--format", "ros2", "--distro", "humble", "--to", str(tmp_path / "ws")]
    assert main(line) == 0
    assert "colcon build" in capsys.readouterr().out
    assert sorted(path.name for path in (tmp_path / "ws").iterdir() if path.is_dir()) == [
        "captain_cam_2_3_1_msgs", "captain_si", "etsi_its_mapem_ts_msgs",
    ]  # fmt: skip
    assert "/opt/ros/humble" in (tmp_path / "ws/captain_cam_2_3_1_msgs/debian/rules").read_text()


@pytest.mark.parametrize("profile", PROFILES)
def test_the_ext_form_of_a_message_alone_is_a_package_that_names_it(profile: str, tmp_path: Path):
    job = Job(SCHEMA, ("denm-2.3.1-ext",), Ros2Options(profile))
    BACKENDS["ros2"].write(job, tmp_path / "ros2", lambda name: None)
    [readme] = [path for path in (tmp_path / "ros2").glob("*/README.md") if "`denm-2.3.1-ext`" in path.read_text()]
    assert list(readme.parent.glob("msg/DENM.msg"))
