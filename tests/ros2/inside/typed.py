"""Made values of one message through a real node, as octets and as objects: a JSON object on stdout.

    typed.py FOLDER EDITION PROFILE COUNT

UPER -> to_cdr -> published as it is -> a typed subscription of rclpy -> published again, typed -> a raw subscription ->
from_cdr -> UPER. FOLDER holds captain_messages. Counted: UPER that comes back; UPER that comes back with the original,
because something has no place in the ROS message; and what does not, because rclpy ends a string at its first NUL, which
IA5String and UTF8String may hold. Half of the values are of a newer sender.
"""

import importlib
import json
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [sys.argv[1], str(ROOT)]

import captain_messages  # noqa: E402
import rclpy  # noqa: E402
from rclpy.qos import QoSHistoryPolicy, QoSProfile  # noqa: E402

from asn1.text import load_schema  # noqa: E402
from tests.asn1.values import Values  # noqa: E402

LONGEST_S = 30.0  # of one message, and until two ends know of each other
QOS = QoSProfile(history=QoSHistoryPolicy.KEEP_LAST, depth=9)


class Echo:
    """A node that is sent octets, and sends the message that it made of them back."""

    def __init__(self, type_: Any) -> None:
        self.node = rclpy.create_node("captain_typed")
        self.heard: list[bytes] = []
        self.there = self.node.create_publisher(type_, "there", QOS)
        self.back = self.node.create_publisher(type_, "back", QOS)
        self.node.create_subscription(type_, "there", self.back.publish, QOS)
        self.node.create_subscription(type_, "back", self.heard.append, QOS, raw=True)
        self._spin_until(lambda: self.there.get_subscription_count() and self.back.get_subscription_count())

    def __call__(self, cdr: bytes) -> bytes:
        self.heard.clear()
        self.there.publish(cdr)
        self._spin_until(lambda: self.heard)
        return bytes(self.heard[0])

    def _spin_until(self, is_done: Any) -> None:
        ends = time.monotonic() + LONGEST_S
        while not is_done():
            if time.monotonic() > ends:
                raise TimeoutError(f"nothing came in {LONGEST_S:.0f} s")
            rclpy.spin_once(self.node, timeout_sec=0.1)


def main(edition: str, profile: str, count: int) -> dict[str, Any]:
    schema = load_schema()
    message = captain_messages.find(edition)
    package, _, name = message.ros2_type(profile).partition("/msg/")
    rclpy.init()
    echo = Echo(getattr(importlib.import_module(f"{package}.msg"), name))
    counts: Counter[str] = Counter()
    trouble = ""
    makers = [Values(schema, schema.messages[edition].pdu, seed, knows_more=seed == 2) for seed in (1, 2)]
    for number in range(count):
        octets = message.encode(makers[number % 2].value())
        cdr, left_out = message.to_cdr(octets, profile)
        heard = echo(cdr)
        how = "original" if left_out else "back"
        if message.from_cdr(heard, profile, original=octets if left_out else None) != octets:
            how = "cut" if _has_nul(message.decode(octets)) else "lost"
            trouble = trouble or (f"{octets.hex()} does not come back" if how == "lost" else "")
        counts[how] += 1
    return {"values": count, "trouble": trouble, **{how: counts[how] for how in ("back", "original", "cut")}}


def _has_nul(value: Any) -> bool:
    """Whether a string in a decoded message holds one."""
    if isinstance(value, dict):
        return any(map(_has_nul, value.values()))
    if isinstance(value, list | tuple):
        return any(map(_has_nul, value))
    return isinstance(value, str) and "\0" in value


if __name__ == "__main__":
    print(json.dumps(main(sys.argv[2], sys.argv[3], int(sys.argv[4]))))
