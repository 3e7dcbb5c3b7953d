"""Peers at a topic with another type or QoS."""

from types import SimpleNamespace

from firmware.gateway.captain_gateway.captain_gateway.peers import peer, strangers
from tests.said import tells

CAM = "etsi_its_cam_msgs/msg/CAM"
HASH, OTHER = bytes(range(32)), bytes(range(1, 33))


def info(node: str, kind: str = CAM, value: bytes | None = HASH, namespace: str = "/") -> SimpleNamespace:
    found = SimpleNamespace(node_name=node, node_namespace=namespace, topic_type=kind, endpoint_gid=[1, 2])
    if value is not None:
        found.topic_type_hash = SimpleNamespace(version=1, value=value)
    return found


def said(*others: SimpleNamespace) -> list[str]:
    return strangers("/cam/transmitted", [peer(info("captain_gateway"))], [peer(one) for one in others])


def test_nothing_is_said_of_those_with_the_same_definition():
    assert said(info("planner"), info("recorder", namespace="/car")) == []


def test_node_with_another_type_is_named_with_both_types():
    (line,) = said(info("planner", "std_msgs/msg/String", namespace="/car"))
    assert tells(line, "/cam/transmitted: /car/planner ", " std_msgs/msg/String ", f" {CAM}: ")


def test_another_definition_is_named_by_its_hash():
    [line] = said(info("planner", value=OTHER))
    assert f"another definition of {CAM}: RIHS01_{OTHER.hex()}, and not RIHS01_{HASH.hex()}" in line
    assert "same message package" in line


def test_a_ros_that_tells_no_hashes_is_believed():
    assert said(info("planner", value=None), info("bridge", value=bytes(32))) == []


def test_nothing_is_said_before_discovery_knows_the_own_end():
    assert strangers("/cam/transmitted", [], [peer(info("planner", "std_msgs/msg/String"))]) == []
