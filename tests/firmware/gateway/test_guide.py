"""Program of firmware/guide/ros2.md: it sets fields that the generated message package has, to valid values."""

import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from asn1.backends.ros2 import profile_etsi_its
from asn1.backends.ros2.model import RosMessage
from asn1.model.text import load_schema
from board.time.scales import generation_delta_time, nearest_its_time_ms
from tests.documents import blocks

PAGE = (Path(__file__).parents[3] / "firmware/guide/ros2.md").read_text()
SCHEMA = load_schema()
PACKAGE = profile_etsi_its.package(SCHEMA, SCHEMA.messages["cam-1.4.1"])
LATE_MS = 5000


def class_of(message: RosMessage) -> type:
    """Return a class with the fields and constants of a .msg file, as rosidl makes it; other attributes are errors."""

    def start(self: Any) -> None:
        for field in message.fields:
            inner = PACKAGE.messages.get(field.type)
            setattr(self, field.name, [] if field.is_array else class_of(inner)() if inner else 0)

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


@pytest.fixture
def own_cam(monkeypatch: pytest.MonkeyPatch) -> Any:
    (code,) = blocks(PAGE, "python ros2")
    for name in ("rclpy", "etsi_its_cam_msgs", "etsi_its_cam_msgs.msg"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    monkeypatch.setattr(sys.modules["etsi_its_cam_msgs.msg"], "CAM", class_of(PACKAGE.top("cam-1.4.1")), raising=False)
    names: dict[str, Any] = {"__name__": "publish_cam"}
    exec(compile(code, "publish_cam.py", "exec"), names)
    return names["own_cam"]


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
        class_of(PACKAGE.top("cam-1.4.1"))().header.stationID = 7
