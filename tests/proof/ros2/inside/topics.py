"""Peers at topics, as JSON: topic -> [publishers, subscriptions].

It waits until each topic has a peer, or WAIT_S.

topics.py TOPICS      a JSON list
"""

import json
import sys
import time

import rclpy

WAIT_S = 15.0


def main(topics: list[str]) -> None:
    rclpy.init()
    node = rclpy.create_node("topics")
    ends = time.monotonic() + WAIT_S
    found: dict[str, tuple[int, int]] = {}
    while time.monotonic() < ends:
        found = {topic: (node.count_publishers(topic), node.count_subscribers(topic)) for topic in topics}
        if all(any(counts) for counts in found.values()):
            break
        time.sleep(0.1)
    print(json.dumps(found))


main(json.loads(sys.argv[1]))
