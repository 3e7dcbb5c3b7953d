"""A message from a publisher of a real node to a typed and a raw subscription, with the hash that discovery tells.

Prints a JSON object: octets as both got them, and the hash. Fails after LONGEST_S.
"""

import importlib
import json
import sys
import time

import rclpy
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message

LONGEST_S = 30.0


def main(package: str, name: str) -> None:
    type_ = getattr(importlib.import_module(f"{package}.msg"), name)
    rclpy.init()
    node = rclpy.create_node("captain_talk")
    typed: list[bytes] = []
    raw: list[bytes] = []
    node.create_subscription(
        type_, "talk", lambda message: typed.append(serialize_message(message)), QoSProfile(depth=9)
    )
    node.create_subscription(type_, "talk", raw.append, QoSProfile(depth=9), raw=True)
    publisher = node.create_publisher(type_, "talk", QoSProfile(depth=9))
    ends = time.monotonic() + LONGEST_S
    while not (typed and raw) and time.monotonic() < ends:
        publisher.publish(type_())
        rclpy.spin_once(node, timeout_sec=0.1)
    [told] = node.get_publishers_info_by_topic("talk")
    hash_ = told.topic_type_hash
    print(
        json.dumps({
            "typed": [one.hex() for one in typed[:1]],
            "raw": [bytes(one).hex() for one in raw[:1]],
            "hash": f"RIHS{hash_.version:02d}_{bytes(hash_.value).hex()}",
        })
    )  # fmt: skip


main(sys.argv[1], sys.argv[2])
