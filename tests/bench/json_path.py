"""Cost of JSON: a CAM from user to radio and from radio to user, as JSON and as octets in alternating rounds.

The generator is this program: it sends at a rate and takes the time of each message. Its own time is part of both figures.
With a subscriber to JSON, the time from radio to port 5556 is measured again: the router's latency beside JSON.
"""

import argparse
import json
import math
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import zmq

from tests.bench import figures, programs
from tests.bench.figures import Line, Round
from tests.bench.start import begin
from tests.bench.subject import SOURCE, Station

RATE = 1000
COUNT = 3000  # messages of a round
WARM_UP = 300
GOAL_US = 2000.0  # median, each way
ROUTER_GOAL = 1.15  # median to 5556 beside a subscriber to JSON, to that without
FASTEST = (1000, 1500, 2000, 3000, 4000, 6000, 8000)  # messages per second
RATE_S = 2.0  # seconds of a rate
PATIENCE_S = 3.0
CAM = bytes.fromhex("02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980")
RESULT = programs.ROOT / "build" / "bench-json.json"


class User:
    """Sockets of a user and of the peer of the interface."""

    def __init__(self, station: Station) -> None:
        ports = station.ports
        self._context = zmq.Context()
        self.push = self._context.socket(zmq.PUSH)
        self.push.connect(f"tcp://127.0.0.1:{ports.pull}")
        self.pdus = self._subscribed(ports.to_users, b"v2x.")
        self.json = self._subscribed(ports.report, b"none")
        self.air = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.air.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        self.air.bind(("127.0.0.1", ports.peer))
        self.air.settimeout(PATIENCE_S)
        self._station = ("127.0.0.1", ports.listen)
        self.body = b""

    def _subscribed(self, port: int, topic: bytes) -> "zmq.Socket[bytes]":
        made = self._context.socket(zmq.SUB)
        made.rcvhwm = 0
        made.rcvtimeo = int(PATIENCE_S * 1000)
        made.connect(f"tcp://127.0.0.1:{port}")
        made.subscribe(topic)
        return made

    def want_json(self) -> None:
        """Subscribe to JSON, and wait until it comes."""
        self.json.subscribe(b"json.")
        while not self.json.poll(50):
            self.throw()
        value = json.loads(self.json.recv_multipart()[1])
        self.body = json.dumps({"edition": value["edition"], "message": value["message"]}).encode()
        self.forget()

    def forget(self) -> None:
        """Discard what has arrived and arrives soon."""
        for one in (self.json, self.pdus):
            while one.poll(100):
                one.recv_multipart()
        self.air.setblocking(False)
        try:
            while self.air.recv(2048):
                pass
        except BlockingIOError:
            self.air.settimeout(PATIENCE_S)

    def throw(self) -> None:
        self.air.sendto(CAM, self._station)

    def push_octets(self) -> None:
        self.push.send_multipart([b"v2x.", CAM])

    def push_json(self) -> None:
        self.push.send_multipart([b"v2x.cam.", self.body, b'{"form": "json"}'])

    def hear(self) -> object:
        return self.air.recv(2048)

    def close(self) -> None:
        self.air.close()
        self._context.destroy(0)


def main() -> int:
    arguments = begin("tests.bench.json_path", __doc__, 7, SOURCE, _add)
    count = max(100, int(COUNT * arguments.scale))
    rounds: list[Round] = []
    again: list[Round] = []
    octets: list[Round] = []
    for number in range(arguments.pairs):
        print(f"pair {number + 1} of {arguments.pairs}", file=sys.stderr, flush=True)
        for found, is_json in ((octets, False), (rounds, True), (again, False)):
            with Station(captain=arguments.captain) as station:
                found.append(_round(station, count, is_json))
    print(f"one CAM of {len(CAM)} octets at {RATE}/s; medians of {arguments.pairs} pairs\n")
    print(figures.table(_lines(octets, rounds, again), "octets", "JSON"))
    with Station(captain=arguments.captain) as station:
        _highest_rates(station)
    RESULT.write_text(json.dumps({"octets": octets, "json": rounds, "again": again}, indent=1))
    return 0


def _add(parser: argparse.ArgumentParser) -> None:
    """Add no option of its own."""


def _round(station: Station, count: int, is_json: bool) -> Round:
    user = User(station)
    try:
        while not user.pdus.poll(50):
            user.throw()
        user.forget()
        if is_json:
            user.want_json()
        send, receive = (
            (user.push_json, user.json.recv_multipart) if is_json else (user.push_octets, user.pdus.recv_multipart)
        )
        made: Round = {}
        for key, give, take in (
            ("to radio", send, user.hear),
            ("to user", user.throw, receive),
            ("to 5556", user.throw, user.pdus.recv_multipart),
        ):
            _latency(give, take, WARM_UP)
            times = _latency(give, take, count)
            made |= {f"{key} median_us": median(times), f"{key} p99_us": times[int(len(times) * 0.99)]}
            user.forget()
        return made | {"memory_kb": _memory_kb(station)}
    finally:
        user.close()


def _latency(give: Callable[[], object], take: Callable[[], object], count: int) -> list[float]:
    """Send messages at RATE, one after the other; return the sorted times until each arrives, in microseconds."""
    times = []
    due = time.perf_counter()
    for _ in range(count):
        while (now := time.perf_counter()) < due:
            pass
        give()
        take()
        times.append((time.perf_counter() - now) * 1e6)
        due = max(due + 1 / RATE, now)
    return sorted(times)


def _memory_kb(station: Station) -> int:
    """Return the resident memory of the station and its processes."""
    children = Path(f"/proc/{station.process.pid}/task/{station.process.pid}/children").read_text().split()
    statuses = [Path(f"/proc/{pid}/status").read_text() for pid in (station.process.pid, *children)]
    return sum(int(line.split()[1]) for text in statuses for line in text.splitlines() if line.startswith("VmRSS:"))


def _highest_rates(station: Station) -> None:
    user = User(station)
    try:
        user.want_json()
        for name, give, take in (
            ("JSON in", user.push_json, user.hear),
            ("JSON out", user.throw, user.json.recv_multipart),
        ):
            best = 0
            for rate in FASTEST:
                if _lost(give, take, rate):
                    break
                best = rate
            user.forget()
            print(f"{name}: {best}/s without loss, of at most {FASTEST[-1]}/s")
    finally:
        user.close()


def _lost(give: Callable[[], object], take: Callable[[], Any], rate: int) -> int:
    """Send at a rate for RATE_S; return the number of messages that did not arrive."""
    count = math.ceil(rate * RATE_S)
    due = time.perf_counter()
    for _ in range(count):
        while time.perf_counter() < due:
            pass
        give()
        due += 1 / rate
    arrived = 0
    try:
        while arrived < count:
            take()
            arrived += 1
    except (zmq.Again, TimeoutError):
        pass
    return count - arrived


def _lines(octets: list[Round], rounds: list[Round], again: list[Round]) -> list[Line]:
    made = []
    for key in ("to radio", "to user"):
        line = figures.compared(f"{key} median_us", octets, rounds, again)
        found = median(one[f"{key} median_us"] for one in rounds)
        made.append(line._replace(goal=f"at most {GOAL_US:g} us", is_reached=found <= GOAL_US))
        made.append(figures.compared(f"{key} p99_us", octets, rounds, again))
    made.append(figures.compared("to 5556 median_us", octets, rounds, again, most=ROUTER_GOAL))
    return [*made, figures.compared("memory_kb", octets, rounds, again)]


if __name__ == "__main__":
    sys.exit(main())
