"""Own position as it is published, with messages of ROS that are no more than what is put into them."""

import importlib
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from firmware.gateway.captain_gateway.captain_gateway.own import quaternion
from tests.said import tells

MODULE = "firmware.gateway.captain_gateway.captain_gateway.own_topics"
MESSAGES = {
    "builtin_interfaces": ["Time"],
    "geometry_msgs": ["PoseStamped", "TransformStamped"],
    "sensor_msgs": ["NavSatFix", "NavSatStatus", "TimeReference"],
    "tf2_msgs": ["TFMessage"],
}


class Message(SimpleNamespace):
    """Its fields are there when they are asked for."""

    def __getattr__(self, name: str) -> "Message":
        made = Message()
        setattr(self, name, made)
        return made


@pytest.fixture
def said(monkeypatch) -> dict[str, list[Any]]:
    """By topic; OwnTopics is told by said["told"]."""
    for package, names in MESSAGES.items():
        module = ModuleType(f"{package}.msg")
        for name in names:
            setattr(module, name, type(name, (Message,), {"STATUS_FIX": 0, "STATUS_GBAS_FIX": 2, "SERVICE_GPS": 1}))
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", module)
    found: dict[str, Any] = {}

    def publisher(type_: object, topic: str) -> SimpleNamespace:
        found[topic] = []
        return SimpleNamespace(publish=found[topic].append)

    topics = importlib.import_module(MODULE)
    del sys.modules[MODULE]
    found["own"] = topics.OwnTopics(Message(get_clock=Message), ("map", "captain"), None, True, publisher)
    return found


def tell(said: dict[str, Any], **more: object) -> None:
    said["own"].status({"position": {"latitude": 47.0, "longitude": 15.0, "source": "gnss", **more}})


@pytest.fixture(autouse=True)
def now(monkeypatch) -> None:
    monkeypatch.setattr(Message, "__call__", lambda self: Message(), raising=False)


def test_station_without_a_heading_has_a_place_and_no_pose(said):
    tell(said)
    assert [len(said[topic]) for topic in ("own/fix", "own/pose", "/tf")] == [1, 0, 0]
    assert tells(said["own"].why_no_transform, "heading", "never known")


def test_a_heading_is_kept_while_it_is_not_known(said):
    tell(said, heading_deg=180.0)
    tell(said)
    turns = [(one.pose.orientation.z, one.pose.orientation.w) for one in said["own/pose"]]
    assert turns == [quaternion(180.0)] * 2
    assert len(said["/tf"]) == 2
    assert said["own"].why_no_transform == ""
