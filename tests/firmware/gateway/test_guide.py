"""Programs of firmware/guide/ros2.md: they use fields that the generated message packages have."""

import re
import sys
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from asn1.backends.ros2 import profile_etsi_its
from asn1.backends.ros2.model import RosMessage, RosPackage
from asn1.model.text import load_schema
from board.time.scales import generation_delta_time, nearest_its_time_ms
from tests.documents import blocks

PAGE = (Path(__file__).parents[3] / "firmware/guide/ros2.md").read_text()
SCHEMA = load_schema()
PACKAGES = {
    name: profile_etsi_its.package(SCHEMA, SCHEMA.messages[edition])
    for name, edition in (("CAM", "cam-1.4.1"), ("DENM", "denm-1.3.1"))
}
TASKS = {code.splitlines()[0].removeprefix("# "): code for code in blocks(PAGE, "python task")}
MOST_LINES = 10
LATE_MS = 5000


def class_of(message: RosMessage, package: RosPackage = PACKAGES["CAM"]) -> type:
    """Return a class with the fields and constants of a .msg file, as rosidl makes it; other attributes are errors."""

    def start(self: Any) -> None:
        for field in message.fields:
            inner = package.messages.get(field.type)
            setattr(self, field.name, [] if field.is_array else class_of(inner, package)() if inner else 0)

    names = {constant.name: constant.value for field in message.fields for constant in field.constants}
    return type(message.name, (), {"__slots__": [field.name for field in message.fields], "__init__": start, **names})


def out_of_range(value: Any, path: str = "") -> list[str]:
    """Return the paths of numbers beyond MIN and MAX of their .msg file."""
    found = []
    for name in type(value).__slots__:
        inner = getattr(value, name)
        if hasattr(type(inner), "__slots__"):
            found += out_of_range(inner, f"{path}.{name}")
        elif name == "value" and hasattr(value, "MAX") and not value.MIN <= inner <= value.MAX:
            found.append(path)
    return found


CAM = class_of(PACKAGES["CAM"].top("cam-1.4.1"))
DENM = class_of(PACKAGES["DENM"].top("denm-1.3.1"), PACKAGES["DENM"])


class Node:
    """Node of ROS that keeps what a program asks of it."""

    def __init__(self) -> None:
        self.heard: dict[str, Any] = {}  # callbacks by topic and type
        self.published: list[tuple[str, Any]] = []
        self.timers: list[tuple[float, Any]] = []
        self.warnings: list[str] = []

    def create_publisher(self, kind: type, topic: str, depth: int) -> Any:
        return SimpleNamespace(publish=lambda message: self.published.append((topic, message)))

    def create_subscription(self, kind: type, topic: str, heard: Any, depth: int) -> None:
        self.heard[topic, kind] = heard

    def create_timer(self, period_s: float, call: Any) -> None:
        self.timers.append((period_s, call))

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=self.warnings.append)

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=1_700_000_000_500_000_000))


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Node:
    """Return the node of rclpy; the message packages have the generated classes."""
    node = Node()
    modules = {
        "rclpy": {"init": lambda: None, "create_node": lambda name: node, "spin": lambda node: None},
        "etsi_its_cam_msgs.msg": {"CAM": CAM},
        "etsi_its_denm_msgs.msg": {"DENM": DENM},
    }
    for name, names in modules.items():
        monkeypatch.setitem(sys.modules, name.partition(".")[0], ModuleType(name))
        monkeypatch.setitem(sys.modules, name, made := ModuleType(name))
        vars(made).update(names)
    return node


def run(code: str, name: str) -> dict[str, Any]:
    """Execute a program as module `name` and return its names."""
    names: dict[str, Any] = {"__name__": name}
    exec(compile(code, name, "exec"), names)
    return names


@pytest.fixture
def own_cam(node: Node) -> Any:
    (code,) = blocks(PAGE, "python ros2")
    return run(code, "publish_cam")["own_cam"]


def test_publish_cam_of_the_guide_sets_valid_values_and_the_time_of_now(own_cam: Any) -> None:
    made = own_cam(48.7668, 11.4320, 10.0, 90.0)
    # Absent parts are zero, which is not always in range; low_frequency_container is present.
    present = [made.header, made.cam.generation_delta_time, made.cam.cam_parameters.basic_container]
    present.append(made.cam.cam_parameters.low_frequency_container)
    vehicle = made.cam.cam_parameters.high_frequency_container.basic_vehicle_container_high_frequency
    present += [
        vehicle.heading,
        vehicle.speed,
        vehicle.vehicle_length,
        vehicle.longitudinal_acceleration,
        vehicle.yaw_rate,
    ]
    assert [path for part in present for path in out_of_range(part)] == []
    assert (made.header.protocol_version, made.header.message_id) == (2, 2)
    assert (vehicle.speed.speed_value.value, vehicle.heading.heading_value.value) == (1000, 900)
    age = generation_delta_time(nearest_its_time_ms(time.time())) - made.cam.generation_delta_time.value
    assert age % 65536 < LATE_MS


def test_class_of_a_message_refuses_a_field_that_its_package_does_not_have() -> None:
    with pytest.raises(AttributeError):
        CAM().header.stationID = 7


@pytest.mark.parametrize("name", TASKS)
def test_task_of_the_guide_has_at_most_ten_lines(name: str) -> None:
    assert len(re.findall(r"^ *[^# \n]", TASKS[name], re.MULTILINE)) <= MOST_LINES


def test_send_cam_of_the_guide_publishes_ten_times_a_second(node: Node, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "publish_cam", module := ModuleType("publish_cam"))
    (code,) = blocks(PAGE, "python ros2")
    vars(module).update(run(code, "publish_cam"))
    run(TASKS["send_cam.py"], "__main__")
    ((period_s, call),) = node.timers
    call()
    ((topic, cam),) = node.published
    assert (period_s, topic, cam.header.station_id.value) == (0.1, "cam/transmitted", 900003)


def test_print_speed_of_the_guide_prints_the_speed_of_vehicles(node: Node, capsys: pytest.CaptureFixture[str]) -> None:
    run(TASKS["print_speed.py"], "__main__")
    cam = CAM()
    cam.header.station_id.value = 7
    high = cam.cam.cam_parameters.high_frequency_container
    high.basic_vehicle_container_high_frequency.speed.speed_value.value = 1389
    node.heard["cam/received", CAM](cam)
    high.choice = high.CHOICE_RSU_CONTAINER_HIGH_FREQUENCY
    node.heard["cam/received", CAM](cam)
    assert capsys.readouterr().out == "7 13.89\n"


def test_warn_of_the_guide_logs_the_cause_of_a_denm(node: Node) -> None:
    run(TASKS["warn.py"], "__main__")
    denm = DENM()
    denm.header.station_id.value = 7
    denm.denm.situation.event_type.cause_code.value = denm.denm.situation.event_type.cause_code.ACCIDENT
    node.heard["denm/received", DENM](denm)
    denm.denm.situation_is_present = True
    node.heard["denm/received", DENM](denm)
    assert node.warnings == ["station 7: cause unknown", "station 7: cause 2"]


def test_log_csv_of_the_guide_prints_a_row_for_each_cam(node: Node, capsys: pytest.CaptureFixture[str]) -> None:
    run(TASKS["log_csv.py"], "__main__")
    cam = CAM()
    cam.header.station_id.value = 7
    place = cam.cam.cam_parameters.basic_container.reference_position
    place.latitude.value, place.longitude.value = 487_668_000, 114_320_000
    node.heard["cam/received", CAM](cam)
    assert capsys.readouterr().out == "1700000000.5,7,48.7668,11.432\n"


def test_republish_of_the_guide_publishes_each_denm_unchanged(node: Node) -> None:
    run(TASKS["republish.py"], "__main__")
    node.heard["denm/received", DENM](denm := DENM())
    assert node.published == [("denm/transmitted", denm)]
