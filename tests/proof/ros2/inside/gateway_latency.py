"""A subscriber of rclpy behind a gateway, and one behind a publisher of this process; when each message came.

    gateway_latency.py CDR typed|raw COUNT      prints JSON: stationID -> nanoseconds of CLOCK_MONOTONIC

The message is CAM, its stationID counts from 1. `ready` is printed when the gateway's publisher is there. Ends when the
last has come, or nothing comes for QUIET_S.
"""

import json
import sys
import time
from typing import Any

import rclpy
from etsi_its_cam_msgs.msg import CAM
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile

QUIET_S = 5.0
STATION_ID = slice(8, 12)  # of a CAM as CDR: behind the encapsulation, two octets and their padding


def main(kind: str, count: int, topic: str) -> None:
    rclpy.init()
    node = rclpy.create_node("latency")
    came: dict[int, int] = {}

    def raw(octets: bytes) -> None:
        came[int.from_bytes(octets[STATION_ID], "little")] = time.monotonic_ns()

    def typed(message: Any) -> None:
        now = time.monotonic_ns()
        came[message.header.station_id.value] = now

    node.create_subscription(CAM, topic, raw if kind == "raw" else typed, QoSProfile(depth=1000), raw=kind == "raw")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not node.count_publishers(topic):
        executor.spin_once(timeout_sec=0.05)
    ends = time.monotonic() + 1.0
    while time.monotonic() < ends:
        executor.spin_once(timeout_sec=0.05)
    print("ready", flush=True)
    last, before = time.monotonic(), 0
    while len(came) < count and time.monotonic() < last + QUIET_S:
        executor.spin_once(timeout_sec=0.5)
        if len(came) != before:
            last, before = time.monotonic(), len(came)
    print(json.dumps(came))


main(sys.argv[1], int(sys.argv[2]), sys.argv[3])
