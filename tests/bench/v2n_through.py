"""1000 messages a second through a broker: by the station, or by plain paho loops that do the same and no more."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.bench.figures import Round
from tests.bench.subject import Subject
from tests.bench.v2n_ends import WARM_UP
from tests.bench.v2n_trouble import Ground, Trouble, Troubled, end, go, is_up

WAYS = ("user-broker", "broker-user")
PATIENCE_S = 60.0
# By V2N alone: what leaves by UDP is another measurement.
ROUTE = """
qos = {qos}

[[policy]]
name = "by V2N alone"
interfaces = ["v2n"]
"""


class PlainPaho(Subject):
    """plain_paho.py: a loop in a thread of paho's own, and one at the user's socket."""

    name = "plain paho"

    def __init__(self, ground: Ground, qos: int) -> None:
        super().__init__()
        self._ground = ground
        self._qos = qos

    def command(self) -> Sequence[str]:
        ground, ports = self._ground, self.ports
        files = (ground.authority.certificate, ground.client.certificate, ground.client.key)
        words = (ports.from_users, ports.to_users, ground.broker.port, self._qos, *files)
        return [sys.executable, "-m", "tests.bench.plain_paho", *map(str, words)]


def through(ground: Ground, captain: str, way: str, qos: int, rate: int, count: int) -> Round:
    """One way at one quality of service: by the station, or by plain paho where captain is empty."""
    trouble = Trouble(ground.interface(ground.broker.port, more=ROUTE.format(qos=qos)), is_up)
    subject = Troubled(captain, trouble) if captain else PlainPaho(ground, qos)
    with subject:
        far = (ground.broker.plain_port, WARM_UP + count, rate, qos)
        users = subject.ports.from_users if way == "user-broker" else subject.ports.to_users
        near = (users, WARM_UP + count, rate, qos)
        sinks = {"user-broker": ("receive-broker", *far), "broker-user": ("receive-user", *near)}
        sources = {"user-broker": ("send-user", *near), "broker-user": ("send-broker", *far)}
        sink, source = end(*sinks[way]), end(*sources[way])
        try:
            before, own_before, broker_before = cpu_s(subject), subject.cpu_s(), ground.broker.cpu_s()
            go(source)
            result = json.loads(sink.communicate(timeout=PATIENCE_S)[0])
            spent, own, broker_spent = (
                cpu_s(subject) - before, subject.cpu_s() - own_before, ground.broker.cpu_s() - broker_before,
            )  # fmt: skip
            go(source)
            source.wait(PATIENCE_S)
        finally:
            _end(sink, source)
    if not result["count"]:
        raise RuntimeError(f"{subject.name}: {way} at QoS {qos}: nothing arrived")
    sent = WARM_UP + count
    made: dict[str, Any] = {
        "median_us": result["median_us"],
        "p99_us": result["p99_us"],
        "cpu_us": 1e6 * spent / sent,
        "first process cpu_us": 1e6 * own / sent,
        "broker cpu_us": 1e6 * broker_spent / sent,
        "lost": count - result["count"],
    }
    return {f"{way} QoS {qos} {key}": value for key, value in made.items()}


def cpu_s(subject: Subject) -> float:
    """Processor time so far of a subject and of the processes that it has started."""
    return sum(_of_process(pid) for pid in _family(subject.process.pid)) / 1e9


def _of_process(pid: int) -> int:
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks)


def _family(pid: int) -> list[int]:
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [pid, *(one for child in children for one in _family(int(child)))]


def _end(*processes: "subprocess.Popen[str]") -> None:
    for one in processes:
        if one.poll() is None:
            one.kill()
        one.communicate()
