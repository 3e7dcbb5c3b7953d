"""`captain run` as it comes: the default ports, and simulated neighbours. In a network of its own, so that they are free."""

import subprocess
import sys
from pathlib import Path

from tests.system.station import PROGRAM

# Runs inside: starts the station, and is a user of it until both types have come.
INSIDE = """
import subprocess, sys, zmq
subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
station = subprocess.Popen(sys.argv[1:], stderr=subprocess.PIPE)
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
station.terminate()
code = station.wait(5)
context.destroy(linger=0)
print(sorted(topic.decode() for topic in topics), all(answers), code)
"""


def test_without_a_configuration_5556_shows_cams_and_denms_of_simulated_neighbours(tmp_path: Path) -> None:
    command = ["unshare", "-Urn", sys.executable, "-c", INSIDE, *PROGRAM, "run"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False, cwd=tmp_path)
    assert done.stdout.strip() == "['hb.counter', 'raw.', 'v2x.cam.', 'v2x.denm.'] True 0", done.stderr
