"""A publisher of rclpy that sends the same CAM: what DDS alone takes. Prints JSON: stationID -> nanoseconds of sending.

plain_publisher.py CDR RATE COUNT TOPIC; begins when a line comes.
"""

import json
import sys
import time

import rclpy
from etsi_its_cam_msgs.msg import CAM
from rclpy.qos import QoSProfile


def main(cdr: bytes, rate: float, count: int, topic: str) -> None:
    rclpy.init()
    node = rclpy.create_node("plain")
    publisher = node.create_publisher(CAM, topic, QoSProfile(depth=1000))
    sys.stdin.readline()
    sent: dict[int, int] = {}
    start = time.monotonic()
    for number in range(1, count + 1):
        time.sleep(max(0.0, start + number / rate - time.monotonic()))
        octets = cdr[:8] + number.to_bytes(4, "little") + cdr[12:]
        sent[number] = time.monotonic_ns()
        publisher.publish(octets)
    print(json.dumps(sent), flush=True)
    sys.stdin.readline()  # what is on its way arrives


main(bytes.fromhex(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3]), sys.argv[4])
