import os
import select
import signal
import socket
import subprocess
import sys

import pytest

from board.runtime.errors import StationError
from firmware.lab import ports, program
from firmware.lab.program import Program

# A station's configuration without an interface, on ports that the kernel chooses.
QUIET = ["run", "--board", "none", "--log", "warning"]


def options(block: int) -> list[str]:
    keys = ("from_users", "to_users", "pull", "report")
    return [word for at, key in enumerate(keys) for word in ("--set", f"endpoint.{key}={block + at}")]


def is_gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def test_a_station_is_ready_when_it_says_so_and_gone_when_stopped(block):
    station = Program("station", [*QUIET, *options(block)])
    station.wait_until_ready()
    assert not ports.is_free("127.0.0.1", block)
    station.check()
    station.stop()
    station.stop()
    assert is_gone(station.pid)
    assert ports.is_free("127.0.0.1", block)


def test_a_station_reads_what_it_is_given(block):
    board = b'name = "given"\n[interfaces.air]\ndriver = "nosuch"\n'
    station = Program("station", ["run", "--board", "/dev/stdin", *options(block)], board)
    with pytest.raises(StationError, match="nosuch"):
        station.wait_until_ready()
    station.stop()


def test_a_child_that_ends_is_told_with_its_last_words():
    station = Program("station Z", ["run", "--set", "endpoint.from_users=many"])
    with pytest.raises(StationError) as told:
        station.wait_until_ready()
    assert told.value.message.startswith("station Z ended with 1: captain: ")
    assert "from_users" in told.value.message
    station.stop()


def test_a_child_that_is_not_ready_in_time_is_not_waited_for(block):
    station = Program("station", [*QUIET, *options(block)])
    with pytest.raises(StationError, match=r"was not ready after 0\.001 s"):
        station.wait_until_ready(timeout=0.001)
    station.stop()
    assert is_gone(station.pid)


def test_a_child_that_does_not_listen_is_killed(block, monkeypatch):
    monkeypatch.setattr(program, "STOP_S", 0.05)
    station = Program("station", [*QUIET, *options(block)])
    os.kill(station.pid, signal.SIGSTOP)
    station.stop()
    assert is_gone(station.pid)


def test_a_terminals_ctrl_c_does_not_reach_a_child(block):
    station = Program("station", [*QUIET, *options(block)])
    assert os.getsid(station.pid) == station.pid
    station.stop()


def test_a_child_ends_with_its_parent_whatever_ended_that(block):
    source = (
        "from firmware.lab.program import Program\n"
        f"station = Program('station', {[*QUIET, *options(block)]!r})\n"
        "station.wait_until_ready()\n"
        "print(station.pid, flush=True)\n"
        "input()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", source], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        pidfd = os.pidfd_open(int(parent.stdout.readline()))
        parent.kill()
    assert select.select([pidfd], [], [], 2.0)[0]
    os.close(pidfd)


def test_a_port_that_somebody_listens_on_is_not_free():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert not ports.is_free("127.0.0.1", port)
    assert ports.is_free("127.0.0.1", port)


def test_blocks_of_ports_leave_out_those_that_are_taken(block):
    with socket.create_server(("127.0.0.1", block + 2)):
        assert next(ports.free_blocks("127.0.0.1", block, 4)) >= block + 10
    assert next(ports.free_blocks("127.0.0.1", block, 4)) == block


def test_no_free_port_is_a_failure_and_not_an_endless_search():
    with pytest.raises(StationError, match="no 4 free ports in a row"):
        next(ports.free_blocks("127.0.0.1", 65_534, 4))


def test_nobody_holds_a_port_without_a_control_socket(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert ports.running(1) is None
