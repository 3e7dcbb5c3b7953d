"""From the endpoint of a station to a subscriber of rclpy, through the gateway: median, 99th percentile, processor.

    .venv/bin/python -m tests.bench.gateway [--duration 10] [--rate 100]

A station's socket is played by this process, which sends each CAM as a station does: RawRxMessage, PDU, indication. In
the same run a publisher of rclpy sends the same octets itself: what remains is what the gateway takes. Needs message
packages that are built, `make ros2 ARGS=--short`; the gateway's own are built here where they are missing.
"""

import argparse
import hashlib
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import zmq

from drivers.message import RxInfo
from drivers.wire import raw
from tests.firmware.gateway.real import CAM
from tests.proof.ros2 import codec, gateway, ros, stations
from tests.system.ports import Ports

RATES = (10, 100, 1000)
HEARTBEAT_S = 1.0
PATIENCE_S = 60.0


class Played:
    """The two sockets of a station that publish."""

    def __init__(self) -> None:
        self._context: zmq.Context[Any] = zmq.Context()
        self._held = Ports()
        self.ports = {name: self._held.take() for name in ("to_users", "report", "pull", "from_users")}
        self._users, self._report = (self._bound(self.ports[name]) for name in ("to_users", "report"))
        self._beat = 0.0

    def send(self, pdu: bytes) -> int:
        """As a station does; CLOCK_MONOTONIC in ns before the first of it."""
        received_ns = time.time_ns()
        rx = RxInfo(btp_port=2001, rssi_dbm=-71)
        told = {
            "digest": hashlib.sha256(pdu).hexdigest()[:16], "interface": "g5", "received_ns": received_ns,
            "btp_port": 2001, "source": "",
        }  # fmt: skip
        message, indication = raw.build(pdu, received_ns, rx), json.dumps(told).encode()
        at = time.monotonic_ns()
        self._users.send_multipart([b"raw.", message])
        self._users.send_multipart([b"v2x.cam.", pdu])
        self._report.send_multipart([b"indication.cam.", indication])
        return at

    def beat(self) -> None:
        if time.monotonic() > self._beat + HEARTBEAT_S:
            self._beat = time.monotonic()
            self._users.send_multipart([b"hb.counter", b'{"heartbeat_counter": 0}'])

    def close(self) -> None:
        self._context.destroy(0)
        self._held.release()

    def _bound(self, port: int) -> Any:
        socket = self._context.socket(zmq.PUB)
        socket.set(zmq.SNDHWM, 0)
        socket.bind(f"tcp://127.0.0.1:{port}")
        return socket


class Found(NamedTuple):
    """Of one run. Times in microseconds; processor: percent of one, NaN where nobody counted."""

    median_us: float
    p99_us: float
    lost: int
    processor: float

    def __str__(self) -> str:
        used = "" if self.processor != self.processor else f"{self.processor:6.1f} %"
        return f"{self.median_us:9.0f} us{self.p99_us:9.0f} us{self.lost:6}{used:>10}"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.gateway", description=__doc__)
    parser.add_argument("--duration", type=float, default=10.0, help="seconds at each rate; default: %(default)g")
    parser.add_argument("--rate", type=int, action="append", metavar="HZ", help="at this one; again for more")
    parser.add_argument("--prefix", type=Path, default=ros.INSTALLED, help="where message packages are installed")
    parser.add_argument("--codec", type=Path, help="a message library with ROS; default: that of make ros2")
    arguments = parser.parse_args()
    installed = arguments.prefix / "share"
    if not (installed / "etsi_its_cam_msgs").exists():
        print(f"gateway: not measured: there is no etsi_its_cam_msgs in {installed}; make ros2 ARGS=--short builds it")
        return 0
    if not (installed / gateway.OWN).exists():
        print(gateway.own_messages(arguments.prefix), flush=True)
    library = arguments.codec or codec.made()
    cdr = stations.load(library).find("cam-1.4.1").to_cdr(CAM)[0]
    print(f"CAM of {len(CAM)} octets, {len(cdr)} as CDR; {arguments.duration:g} s at each rate")
    print(f"{'':34}{'median':>12}{'99 %':>12}{'lost':>6}{'gateway':>10}")
    is_lost = False
    for rate in arguments.rate or RATES:
        count = round(rate * arguments.duration)
        for kind in ("raw", "typed"):
            plain = _plain(cdr, kind, rate, count, library, arguments.prefix)
            print(f"{rate:5} a second, {kind:6} by rclpy alone {plain}", flush=True)
            for has_metadata in (False, True) if kind == "raw" else (False,):
                found = _through(kind, rate, count, library, arguments.prefix, has_metadata)
                beside = ", metadata" if has_metadata else ""
                print(f"{rate:5} a second, {kind + beside:22}{found}", flush=True)
                is_lost |= found.lost > 0
    return int(is_lost)


def _through(kind: str, rate: float, count: int, library: Path, prefix: Path, has_metadata: bool) -> Found:
    played = Played()
    words = [ros.ENV / "bin" / "python", "-m", "captain_gateway", "--ros-args", "-p", "handlers:=[cam]"]
    words += ["-p", "qos_overrides./cam/received.publisher.depth:=1000"]  # as the other publisher has it
    words += [word for name, port in played.ports.items() for word in ("-p", f"station.{name}:={port}")]
    environment = stations.environment(library, prefix)
    log = ros.MADE / "gateway_bench.log"
    with stations.Node(words, environment, log) as node, _metadata(environment, has_metadata):
        ear = _ear(kind, count, environment, "/cam/received")
        until = time.monotonic() + PATIENCE_S
        while "a station is heard" not in node.said and time.monotonic() < until:
            played.beat()
            time.sleep(0.1)
        _ready(ear)
        before, sent, start = node.processor_s(), {}, time.monotonic()
        for number in range(1, count + 1):
            time.sleep(max(0.0, start + number / rate - time.monotonic()))
            played.beat()
            sent[number] = played.send(CAM[:2] + number.to_bytes(4, "big") + CAM[6:])
        came = _came(ear)
        used = (node.processor_s() - before) / (time.monotonic() - start)
    played.close()
    return _found(sent, came, 100 * used)


def _plain(cdr: bytes, kind: str, rate: float, count: int, library: Path, prefix: Path) -> Found:
    environment = stations.environment(library, prefix)
    words = [ros.ENV / "bin" / "python", ros.INSIDE / "plain_publisher.py", cdr.hex(), rate, count, "/plain"]
    with subprocess.Popen(
        [str(word) for word in words], env=environment, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as publisher:
        assert publisher.stdin is not None
        assert publisher.stdout is not None
        ear = _ear(kind, count, environment, "/plain")
        _ready(ear)
        publisher.stdin.write("\n")
        publisher.stdin.flush()
        sent = {int(number): at for number, at in json.loads(publisher.stdout.readline()).items()}
        came = _came(ear)
        publisher.stdin.write("\n")
    return _found(sent, came, float("nan"))


def _metadata(environment: Mapping[str, str], is_wanted: bool) -> stations.Node:
    """Somebody who takes it all the time, or nobody."""
    script = "import time; time.sleep(1e6)" if not is_wanted else METADATA
    return stations.Node([ros.ENV / "bin" / "python", "-c", script], environment, ros.MADE / "gateway_metadata.log")


METADATA = """
import rclpy
from captain_gateway_msgs.msg import Metadata
rclpy.init()
node = rclpy.create_node("metadata")
node.create_subscription(Metadata, "/cam/received/metadata", lambda octets: None, 100, raw=True)
try:
    rclpy.spin(node)
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    pass
"""


def _ear(kind: str, count: int, environment: Mapping[str, str], topic: str) -> "subprocess.Popen[str]":
    words = [str(ros.ENV / "bin" / "python"), str(ros.INSIDE / "gateway_latency.py"), kind, str(count), topic]
    return subprocess.Popen(words, env=dict(environment), text=True, stdout=subprocess.PIPE)


def _ready(ear: "subprocess.Popen[str]") -> None:
    assert ear.stdout is not None
    assert ear.stdout.readline() == "ready\n"


def _came(ear: "subprocess.Popen[str]") -> dict[int, int]:
    said, _ = ear.communicate()
    return {int(number): at for number, at in json.loads(said.splitlines()[-1]).items()}


def _found(sent: Mapping[int, int], came: Mapping[int, int], processor: float) -> Found:
    late = sorted((came[number] - at) / 1e3 for number, at in sent.items() if number in came)
    if not late:
        return Found(float("nan"), float("nan"), len(sent), processor)
    return Found(statistics.median(late), late[round(0.99 * (len(late) - 1))], len(sent) - len(late), processor)


if __name__ == "__main__":
    sys.exit(main())
