"""A started station and its MQTT processes, and what the kernel says they hold."""

import os
import statistics
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tests.broker.certificates import Authority
from tests.proof.chaos.run import Goal
from tests.proof.outage.link import BROKER
from tests.system.station import Station

PORT = 8883
UP_S = 20.0

# Resident memory, of a straight line through the samples of the second half: what an allocator does, no leak.
FLAT_KB_PER_MIN = 100.0
SETTLED_S = 300.0  # a shorter run shows how tables fill, not what grows


class Sample(NamedTuple):
    """Of one process: resident memory in kB, and open descriptors."""

    at_s: float
    memory_kb: int
    descriptors: int


class Samples:
    """Of the station, and of each of its children, by process id."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.by_pid: dict[int, list[Sample]] = {}

    def take(self) -> None:
        now = time.monotonic()
        for pid in (self.pid, *children(self.pid)):
            try:
                sample = Sample(now, _memory_kb(pid), len(os.listdir(f"/proc/{pid}/fd")))
            except OSError:  # it has just ended
                continue
            self.by_pid.setdefault(pid, []).append(sample)

    def goals(self, expected: int) -> list[Goal]:
        """expected: children."""
        count = len(self.by_pid) - 1
        goals = [Goal("the processes with the clients are those of the start", str(count), count == expected)]
        for pid, samples in self.by_pid.items():
            who = "the station" if pid == self.pid else f"process {pid}"
            goals += [_memory(who, samples), _descriptors(who, samples)]
        return goals


def children(pid: int) -> list[int]:
    return [int(text) for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def configured(station: Station, folder: Path, authority: Authority, paths: Sequence[tuple[str, int]]) -> None:
    """captain.toml with an interface for each path, (name, QoS): all its defaults but for where the broker is."""
    identity = authority.client("outage")
    common = {
        "driver": "mqtt",
        "url": f"mqtts://{BROKER}:{PORT}",
        "ca": str(authority.certificate),
        "certificate": str(identity.certificate),
        "key": str(identity.key),
    }
    station.configure({name: {**common, "client_id": name, "qos": qos} for name, qos in paths})


def wait_until_up(station: Station, names: Sequence[str]) -> None:
    station.until(lambda status: all(status["interfaces"][name]["state"] == "up" for name in names), UP_S)


def _memory(who: str, samples: Sequence[Sample]) -> Goal:
    half = samples[len(samples) // 2 :]
    slope = 0.0
    if len(half) > 2:
        line = statistics.linear_regression([one.at_s for one in half], [one.memory_kb for one in half])
        slope = 60.0 * line.slope
    is_long = samples[-1].at_s - samples[0].at_s >= SETTLED_S
    seen = f"{samples[0].memory_kb} to {samples[-1].memory_kb} kB, {slope:+.0f} kB/min in the second half"
    seen += "" if is_long else ": too short to tell"
    return Goal(f"memory of {who} is flat", seen, not is_long or slope < FLAT_KB_PER_MIN)


def _descriptors(who: str, samples: Sequence[Sample]) -> Goal:
    first, last = samples[0].descriptors, samples[-1].descriptors
    most = max(one.descriptors for one in samples)
    return Goal(f"{who} has as many descriptors as before", f"{first}, {last}; at most {most}", first == last)


def _memory_kb(pid: int) -> int:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next((int(line.split()[1]) for line in lines if line.startswith("VmRSS:")), 0)
