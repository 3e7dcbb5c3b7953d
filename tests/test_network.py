"""Network of a test process: each process has its own loopback and ports."""

import socket
import subprocess
import sys

HOLD_PORT = """
import socket
from tests.network import isolate
isolate()
with socket.create_server(("127.0.0.1", 20027)):
    print("bound", flush=True)
    input()
"""


def test_network_of_two_processes_with_the_same_port_has_no_clash():
    command = [sys.executable, "-c", HOLD_PORT]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen(command, **pipes) as first, subprocess.Popen(command, **pipes) as second:
        assert [one.stdout.readline() for one in (first, second)] == ["bound\n", "bound\n"]
        for one in (first, second):
            one.communicate("\n")


def test_network_of_the_tests_has_the_loopback_of_both_protocols():
    for family, address in ((socket.AF_INET, "127.0.0.1"), (socket.AF_INET6, "::1")):
        with socket.create_server((address, 0), family=family) as server:
            socket.create_connection(server.getsockname()[:2]).close()
