"""Commands with default ports and simulated neighbours, in a network namespace."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.system.station import PROGRAM

# Program in the namespace: starts a command, receives from its station until both types have come, then runs a swarm.
INSIDE = """
import atexit, json, subprocess, sys, zmq
subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
*program, verb = sys.argv[1:]
station = subprocess.Popen([*program, verb], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
atexit.register(station.kill)
context = zmq.Context()
sub = context.socket(zmq.SUB)
sub.rcvtimeo = 5000
sub.reconnect_ivl = 10
sub.subscribe(b"")
sub.connect("tcp://127.0.0.1:5556")
topics = set()
while not {b"raw.", b"v2x.cam.", b"v2x.denm.", b"hb.counter"} <= topics:
    topics.add(sub.recv_multipart()[0])
answers = []
for kind, port in ((zmq.PUB, 5555), (zmq.PUSH, 5557), (zmq.SUB, 5558)):
    monitored = context.socket(kind)
    monitor = monitored.get_monitor_socket(zmq.EVENT_HANDSHAKE_SUCCEEDED)
    monitored.connect(f"tcp://127.0.0.1:{port}")
    answers.append(monitor.poll(5000))
command = [*program, "swarm", "3", "--rate", "10", "--duration", "0.3", "--json"]
swarm = subprocess.run(command, capture_output=True, text=True)
stations, wanted = set(), {100001, 100002, 100003} if swarm.returncode == 0 else set()
while not wanted <= stations:
    envelope, body = sub.recv_multipart()
    stations |= {int.from_bytes(body[2:6])} & wanted if envelope == b"v2x.cam." else set()
station.terminate()
code = station.wait(5)
context.destroy(linger=0)
told = {"topics": sorted(topic.decode() for topic in topics), "answers": all(answers), "code": code}
print(json.dumps({**told, "swarm": swarm.returncode, "said": swarm.stdout, "err": swarm.stderr}))
"""


def seen(verb: str, folder: Path) -> dict[str, Any]:
    """Return the output and results of a command without options."""
    command = ["unshare", "-Urn", sys.executable, "-c", INSIDE, *PROGRAM, verb]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False, cwd=folder)
    assert done.returncode == 0, done.stderr
    told: dict[str, Any] = json.loads(done.stdout)
    return told


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    return seen("run", tmp_path_factory.mktemp("run"))


def test_without_a_configuration_5556_shows_cams_and_denms_of_simulated_neighbours(run: dict[str, Any]) -> None:
    assert (run["topics"], run["answers"], run["code"]) == (["hb.counter", "raw.", "v2x.cam.", "v2x.denm."], True, 0)


def test_a_swarm_without_options_is_received_by_users_of_run_without_options(run: dict[str, Any]) -> None:
    assert_received(run)


def test_a_swarm_without_options_is_received_by_users_of_the_demo_without_options(tmp_path: Path) -> None:
    assert_received(seen("demo", tmp_path))


def assert_received(told: dict[str, Any]) -> None:
    assert told["swarm"] == 0, told
    said = json.loads(told["said"])
    assert (said["sent"], said["unheard"], said["is_received"]) == (9, 0, True)
