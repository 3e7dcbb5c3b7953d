"""Made values of one message through a real node, as octets and as objects: a JSON object on stdout.

    typed.py FOLDER EDITION PROFILE COUNT [PORTS HANDLER SUFFIX]

SUFFIX: of the type that topics carry, List or nothing. With ports: a station that is played here -> the gateway -> a typed subscription of rclpy -> published again, typed -> the
gateway -> the station. Without: UPER -> to_cdr -> published as it is -> a typed subscription -> published again -> a raw
subscription -> from_cdr -> UPER. FOLDER holds captain_messages. Counted: UPER that comes back; UPER that comes back with
what was kept beside, because something has no place in the ROS message; and what was made and left out, because rclpy ends
a string at its first NUL, which IA5String and UTF8String may hold. Half of the values are of a newer sender.
"""

import importlib
import json
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[4]
sys.path[:0] = [sys.argv[1], str(ROOT)]

import captain_messages
import rclpy
from rcl_interfaces.msg import Log
from rclpy.qos import QoSHistoryPolicy, QoSProfile

from asn1.model.text import load_schema
from drivers.message import Position, RxInfo
from tests.asn1.values import Values
from tests.proof.ros2.inside.gateway_station import Played

LONGEST_S = 30.0  # of one message, and until two ends know of each other
QOS = QoSProfile(history=QoSHistoryPolicy.KEEP_LAST, depth=9)
LONGEST = 1500  # octets of a message that a station takes
RX, OWN = RxInfo(btp_port=2001, rssi_dbm=-71), Position(470600000, 154700000)


class LostError(Exception):
    """A message did not come."""


class Echo:
    """A node that is sent a message, and sends the object that it made of it back."""

    def __init__(self, message: Any, profile: str, suffix: str = "") -> None:
        package, _, name = message.ros2_type(profile).partition("/msg/")
        self.type = getattr(importlib.import_module(f"{package}.msg"), name + suffix)
        self.message, self.profile = message, profile
        self.node = rclpy.create_node("captain_typed")

    def __call__(self, octets: bytes) -> bytes:
        """What comes back of a message in UPER. Raises LostError."""
        raise NotImplementedError

    def connect(self, octets: bytes) -> None:
        """Once, before the first: a message that may be lost."""

    def turn(self) -> None:
        rclpy.spin_once(self.node, timeout_sec=0.1)

    def until(self, is_done: Callable[[], Any]) -> Any:
        ends = time.monotonic() + LONGEST_S
        while not (found := is_done()):
            if time.monotonic() > ends:
                raise LostError(f"nothing came in {LONGEST_S:.0f} s")
            self.turn()
        return found


class Alone(Echo):
    """Without a gateway, which knows the type by no name: its messages go between a station and its users."""

    def __init__(self, message: Any, profile: str) -> None:
        super().__init__(message, profile)
        self.heard: list[bytes] = []
        self.there = self.node.create_publisher(self.type, "there", QOS)
        self.back = self.node.create_publisher(self.type, "back", QOS)
        self.node.create_subscription(self.type, "there", self.back.publish, QOS)
        self.node.create_subscription(self.type, "back", self.heard.append, QOS, raw=True)
        self.until(lambda: self.there.get_subscription_count() and self.back.get_subscription_count())

    def __call__(self, octets: bytes) -> bytes:
        cdr, left_out = self.message.to_cdr(octets, self.profile)
        self.heard.clear()
        self.there.publish(cdr)
        heard = bytes(self.until(lambda: self.heard)[0])
        return bytes(self.message.from_cdr(heard, self.profile, original=octets if left_out else None))


class Gateway(Echo):
    """Between a station that is played and the node."""

    def __init__(self, message: Any, profile: str, ports: dict[str, int], handler: str, suffix: str) -> None:
        super().__init__(message, profile, suffix)
        self.handler, self.station = handler, Played(ports)
        self.said: list[str] = []
        self.back = self.node.create_publisher(self.type, f"{handler}/transmitted", QOS)
        heard = self.node.create_subscription(self.type, f"{handler}/received", self.back.publish, QOS)
        self.node.create_subscription(Log, "/rosout", lambda log: self.said.append(log.msg), 100)
        self.until(lambda: self.back.get_subscription_count() and heard.get_publisher_count())

    def turn(self) -> None:
        self.station.turn()
        rclpy.spin_once(self.node, timeout_sec=0.0005)

    def connect(self, octets: bytes) -> None:
        """Until the gateway's sockets have found the station, and what was sent meanwhile has come."""
        ends = time.monotonic() + LONGEST_S
        while not self.station.taken and time.monotonic() < ends:
            self.station.indicate(self.handler, octets, RX, OWN, None)
            self.spin(0.3)
        self.spin(0.5)

    def spin(self, seconds: float) -> None:
        ends = time.monotonic() + seconds
        while time.monotonic() < ends:
            self.turn()

    def __call__(self, octets: bytes) -> bytes:
        self.station.taken.clear()
        self.said.clear()
        self.station.indicate(self.handler, octets, RX, OWN, None)
        try:
            _, pdu, *_ = self.until(lambda: self.station.taken)[0]
        except LostError as error:
            raise LostError(f"{error}; the gateway said: {self.said[-1:]}") from None
        return bytes(pdu)


def main(edition: str, profile: str, count: int, ports: dict[str, int], handler: str, suffix: str) -> dict[str, Any]:
    message = captain_messages.find(edition)
    rclpy.init()
    echo = Gateway(message, profile, ports, handler, suffix) if ports else Alone(message, profile)
    values, cut = _values(message, count, head=bytes((message.versions[-1], message.ids[0])) if ports else b"")
    counts: Counter[str] = Counter(cut=cut)
    trouble = ""
    echo.connect(values[0])
    for octets in values:
        try:
            came = echo(octets)
        except LostError as error:
            trouble = f"{octets.hex()}: {error}"
            break
        if came != octets:
            trouble = trouble or f"{octets.hex()} does not come back"
        else:
            counts["original" if message.to_cdr(octets, profile)[1] else "back"] += 1
    return {"values": count, "trouble": trouble, **{how: counts[how] for how in ("back", "original", "cut")}}


def _values(message: Any, count: int, head: bytes) -> tuple[list[bytes], int]:
    """Octets of made ones, every other of a newer sender, and how many were left out for a NUL.

    head: what each begins with, as the gateway asks for; then none is longer than a station takes.
    """
    schema = load_schema()
    makers = [Values(schema, schema.messages[message.name].pdu, seed, knows_more=seed == 2) for seed in (1, 2)]
    found: list[bytes] = []
    cut = 0
    while len(found) < count:
        octets = message.encode(makers[len(found) % 2].value())
        if head and len(octets) > LONGEST:
            continue
        if _has_nul(message.decode(octets)):
            cut += 1
        else:
            found.append(head + octets[len(head) :])
    return found, cut


def _has_nul(value: Any) -> bool:
    """Whether a string in a decoded message holds one."""
    if isinstance(value, dict):
        return any(map(_has_nul, value.values()))
    if isinstance(value, list | tuple):
        return any(map(_has_nul, value))
    return isinstance(value, str) and "\0" in value


if __name__ == "__main__":
    _, chosen, names, number, *rest = sys.argv[1:]
    given, handler, suffix = rest or ("{}", "", "")
    print(json.dumps(main(chosen, names, int(number), json.loads(given), handler, suffix)))
