"""Nodes at two gateways: each publishes every message so many times a second, typed; the other's are compared.

    gateway_table.py MESSAGES DURATION RATE

MESSAGES: a JSON file, handler -> [ROS type, serialised message in hexadecimal]. The gateways are in the namespaces /a
and /b. Every message has a stationID of its own. Prints JSON: a row of sent, received, equal, lost for each type and way.
"""

import contextlib
import importlib
import json
import sys
import threading
import time
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message

PATIENCE_S = 60.0
QUIET_S = 3.0  # what has not come so long after the last has not come
QOS = QoSProfile(depth=1000)


def header_of(message: Any) -> Any:
    """The ItsPduHeader; that of VAM is in one of its own."""
    header = message.header
    return header if hasattr(header, "station_id") else header.value


def numbered(message: Any, number: int) -> Any:
    """Its stationID; DENM and others say it once more inside, where it stays."""
    header = header_of(message)
    if hasattr(header.station_id, "value"):
        header.station_id.value = number
    else:
        header.station_id = number
    return message


def number_of(message: Any) -> int:
    station = header_of(message).station_id
    return int(getattr(station, "value", station))


class Way:
    """From one side to the other, of one type."""

    def __init__(self, node: Any, handler: str, ros_type: str, cdr: bytes, sender: str, receiver: str) -> None:
        package, _, name = ros_type.split("/")
        self.type = getattr(importlib.import_module(f"{package}.msg"), name)
        self.handler, self.sender, self.receiver, self.cdr = handler, sender, receiver, cdr
        self.message = deserialize_message(cdr, self.type)
        self.sent: set[int] = set()
        self.received: dict[int, Any] = {}
        self.again = 0
        self.publisher = node.create_publisher(self.type, f"/{sender}/{handler}/transmitted", QOS)
        self.subscription = node.create_subscription(self.type, f"/{receiver}/{handler}/received", self.hear, QOS)

    def is_connected(self) -> bool:
        return self.publisher.get_subscription_count() > 0 and self.subscription.get_publisher_count() > 0

    def send(self, number: int) -> None:
        self.publisher.publish(numbered(self.message, number))
        self.sent.add(number)

    def hear(self, message: Any) -> None:
        number = number_of(message)
        self.again += number in self.received
        self.received[number] = message

    def row(self) -> dict[str, object]:
        expected = deserialize_message(self.cdr, self.type)
        equal = sum(
            numbered(expected, number) == message for number, message in self.received.items() if number in self.sent
        )
        return {
            "type": self.handler, "from": self.sender, "sent": len(self.sent), "received": len(self.received) + self.again,
            "equal": equal, "lost": len(self.sent - self.received.keys()), "octets": len(self.cdr),
        }  # fmt: skip


def spin(node: Any) -> None:
    with contextlib.suppress(ExternalShutdownException):
        rclpy.spin(node)


def main(path: str, duration: float, rate: float) -> None:
    with open(path) as file:
        given = json.load(file)
    rclpy.init()
    node = rclpy.create_node("lab")
    ways = [
        Way(node, handler, ros_type, bytes.fromhex(cdr), *ends)
        for handler, (ros_type, cdr) in given.items()
        for ends in (("a", "b"), ("b", "a"))
    ]
    spinning = threading.Thread(target=spin, args=(node,), daemon=True)
    spinning.start()
    ends = time.monotonic() + PATIENCE_S
    while not all(way.is_connected() for way in ways):
        if time.monotonic() > ends:
            sys.exit(f"not connected: {[(way.sender, way.handler) for way in ways if not way.is_connected()]}")
        time.sleep(0.1)
    time.sleep(1.0)  # the gateways know by now that somebody is there
    number, start = 1000, time.monotonic()
    for turn in range(round(duration * rate)):
        for place, way in enumerate(ways):
            due = start + (turn + place / len(ways)) / rate
            time.sleep(max(0.0, due - time.monotonic()))
            number += 1
            way.send(number)
    took = time.monotonic() - start
    last, missing = time.monotonic(), -1
    while time.monotonic() < last + QUIET_S:
        now = sum(len(way.sent - way.received.keys()) for way in ways)
        if now != missing:
            last, missing = time.monotonic(), now
        if not now:
            break
        time.sleep(0.1)
    rclpy.shutdown()
    spinning.join()
    print(json.dumps({"took_s": took, "rows": [way.row() for way in ways]}))


main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]))
