"""A node at a gateway whose station is played: what came, what was said, and how long it is waited for."""

import time
from collections.abc import Callable
from typing import Any

import captain_messages
import rclpy
from captain_gateway_msgs.msg import Confirm, Metadata, Request
from diagnostic_msgs.msg import DiagnosticArray
from etsi_its_cam_msgs.msg import CAM
from etsi_its_denm_msgs.msg import DENM
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.msg import Log, Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import NavSatFix, TimeReference
from tf2_msgs.msg import TFMessage

from drivers.message import Position, RxInfo
from tests.proof.ros2.inside.gateway_station import Played

PATIENCE_S = 30.0
NAME = "/captain_gateway"
RX = RxInfo(
    btp_port=2001, rssi_dbm=-71, data_rate=12, traffic_class=2, hop_limit=3,
    position=Position(470585000, 154600000), source_mac=bytes.fromhex("020304050607"),
)  # fmt: skip
OWN = Position(470600000, 154700000)


class WrongError(Exception):
    """A goal that is not met."""


class Bench:
    """messages: a real one of each handler, by its name. other: a prefix with another definition of CAM, or ""."""

    def __init__(self, ports: dict[str, int], messages: dict[str, bytes], other: str) -> None:
        self.messages, self.other = messages, other
        self.station = Played(ports)
        self.node = rclpy.create_node("test")
        self.cams: list[tuple[Any, dict[str, int]]] = []
        self.denms: list[Any] = []
        self.heard: dict[str, list[Any]] = {}
        self.said: list[str] = []
        self.diagnostics: dict[str, Any] = {}
        node = self.node
        node.create_subscription(CAM, "cam/received", lambda message, info: self.cams.append((message, info)), 100)
        node.create_subscription(
            DENM, "denm/received", self.denms.append, QoSProfile(depth=9, reliability=ReliabilityPolicy.BEST_EFFORT)
        )
        node.create_subscription(Log, "/rosout", lambda log: self.said.append(log.msg), 1000)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnosed, 10)
        for name, type_ in (
            ("cam/received/metadata", Metadata), ("confirm", Confirm), ("own/fix", NavSatFix), ("own/pose", PoseStamped),
            ("own/time_reference", TimeReference), ("/tf", TFMessage),
        ):  # fmt: skip
            self.heard[name] = []
            node.create_subscription(type_, name, self.heard[name].append, 100)
        self.cam = node.create_publisher(CAM, "cam/transmitted", 100)
        self.denm = node.create_publisher(DENM, "denm/transmitted", 100)
        self.request = node.create_publisher(Request, "request", 100)

    def _diagnosed(self, array: Any) -> None:
        for status in array.status:
            self.diagnostics[status.name.partition(": ")[2]] = status

    def spin(self, seconds: float) -> None:
        ends = time.monotonic() + seconds
        while time.monotonic() < ends:
            self.station.turn()
            rclpy.spin_once(self.node, timeout_sec=0.02)

    def until(self, holds: Callable[[], Any], what: str) -> Any:
        ends = time.monotonic() + PATIENCE_S
        while not (found := holds()):
            if time.monotonic() > ends:
                raise WrongError(f"{what}: never; last said: {self.said[-2:]}")
            self.station.turn()
            rclpy.spin_once(self.node, timeout_sec=0.02)
        return found

    def call(self, type_: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(type_, name)
        self.until(client.service_is_ready, f"service {name}")
        future = client.call_async(request)
        self.until(future.done, f"answer of {name}")
        return future.result()

    def set(self, name: str, value: Any) -> Any:
        made = ParameterValue()
        kinds = {bool: "bool", int: "integer", float: "double", str: "string"}
        if isinstance(value, list):
            kind = {int: "integer_array", float: "double_array", str: "string_array"}[type(value[0])]
        else:
            kind = kinds[type(value)]
        made.type = getattr(ParameterType, f"PARAMETER_{kind.upper()}")
        setattr(made, f"{kind}_value", value)
        asked = SetParameters.Request(parameters=[Parameter(name=name, value=made)])
        return self.call(SetParameters, f"{NAME}/set_parameters", asked).results[0]

    def diagnosed(self, name: str, key: str) -> str:
        status = self.diagnostics.get(name)
        values = {} if status is None else {pair.key: pair.value for pair in status.values}
        return values.get(key, "")

    def until_said(self, words: str) -> str:
        return str(
            self.until(lambda: next((line for line in self.said if words in line), None), f"a line with {words!r}")
        )

    def count(self, name: str, key: str) -> int:
        """What diagnostics have counted under a key; 0 where they say nothing of it."""
        return int(self.diagnosed(name, key) or 0)

    def until_counted(self, name: str, key: str, wanted: int) -> None:
        self.until(lambda: self.count(name, key) >= wanted, f"{key} of {name}: {wanted}")
        if self.count(name, key) != wanted:
            raise WrongError(f"{key} of {name} is {self.count(name, key)}, not {wanted}")

    def until_diagnosed(self, name: str, key: str, words: str) -> str:
        self.until(
            lambda: words in self.diagnosed(name, key),
            f"{key} of {name} with {words!r}, not {self.diagnosed(name, key)!r}",
        )
        return self.diagnosed(name, key)

    def typed(self, pdu: bytes, edition: str, type_: Any) -> Any:
        return deserialize_message(captain_messages.find(edition).to_cdr(pdu)[0], type_)

    def numbered(self, number: int) -> bytes:
        cam = self.messages["cam"]
        return cam[:2] + number.to_bytes(4, "big") + cam[6:]

    def sent_since(self, before: int) -> list[list[bytes]]:
        return self.station.taken[before:]
