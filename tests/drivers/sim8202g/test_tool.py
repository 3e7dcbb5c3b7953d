"""Tools: real programs as child processes on a real clock, which end or are ended."""

import errno
import os
import sys
import time

import pytest

from board.machine import Machine
from board.runtime.errors import BlockedError, InterfaceError
from board.runtime.loop import Loop
from board.runtime.tool import MAX_OUTPUT, Tool
from drivers.sim8202g.script import Ended, Run, StepError
from drivers.sim8202g.system import Route, System


@pytest.fixture
def loop():
    loop = Loop()
    yield loop
    loop.close()


def until(loop, is_done, within_s=5.0):
    end = time.monotonic() + within_s
    while not is_done():
        assert time.monotonic() < end
        loop.after(0.01, lambda: None)
        loop.turn()


def run(loop, *argv, limit_s=5.0, **more):
    """Start a tool; return it and the list that receives its result."""
    said = []
    return Tool(loop, argv, limit_s, lambda *result: said.append(result), **more), said


@pytest.mark.parametrize(("before", "given"), [("", "none"), ("/opt/lib", "/opt/lib")])
def test_a_frozen_station_keeps_its_libraries_to_itself(loop, monkeypatch, before, given):
    monkeypatch.setattr(sys, "frozen", True, raising=False)
    monkeypatch.setenv("LD_LIBRARY_PATH", "/unpacked/station")
    if before:
        monkeypatch.setenv("LD_LIBRARY_PATH_ORIG", before)
    monkeypatch.setenv("_PYI_PARENT_PROCESS_LEVEL", "1")  # by which a captain takes itself for this one's worker
    _, said = run(
        loop,
        "sh",
        "-c",
        "echo ${LD_LIBRARY_PATH:-none} ${LD_LIBRARY_PATH_ORIG:-none} ${_PYI_PARENT_PROCESS_LEVEL:-none}",
    )
    until(loop, lambda: said)

    assert said == [(0, f"{given} none none\n")]


def test_what_it_says_comes_with_its_exit_status(loop):
    _, said = run(loop, "sh", "-c", "echo out; echo err >&2; exit 3")
    until(loop, lambda: said)
    assert said == [(3, "out\nerr\n")]
    assert not loop._sources


def test_what_it_says_beyond_measure_is_thrown_away_and_it_is_not_held_up(loop):
    _, said = run(loop, "sh", "-c", "yes 0123456789 | head -c 1000000")
    until(loop, lambda: said)
    assert (said[0][0], len(said[0][1])) == (0, MAX_OUTPUT)


def test_it_is_ended_when_its_time_is_over(loop):
    _, said = run(loop, "sleep", "100", limit_s=0.05)
    until(loop, lambda: said)
    assert said[0][0] < 0


def test_one_that_is_not_installed_blocks_with_what_to_install(loop, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BlockedError, match="qmicli is not installed") as caught:
        run(loop, "qmicli", "--version")
    assert "libqmi-utils" in caught.value.hint


def test_one_that_is_kept_goes_on_and_its_end_is_told(loop):
    ended = []
    tool, said = run(
        loop,
        "sh",
        "-c",
        "echo lease of 10.0.0.2 obtained; exec sleep 100",
        keep="lease of",
        ended=lambda: ended.append(1),
    )
    until(loop, lambda: said)
    assert said == [(None, "lease of 10.0.0.2 obtained\n")]
    assert not ended
    tool.stop()
    until(loop, lambda: ended)
    assert len(said) == 1
    assert not loop._sources


def test_one_that_is_left_is_ended_and_tells_nobody(loop):
    ended = []
    tool, said = run(loop, "sleep", "100", ended=lambda: ended.append(1))
    tool.leave()
    until(loop, lambda: not loop._sources)
    assert (said, ended) == ([], [])


def test_a_system_ends_what_it_kept(loop):
    system, results = System(Machine()), []
    system.run(loop, Run(("sh", "-c", "echo up; exec sleep 100"), 5.0, "up"), results.append, lambda: None)
    until(loop, lambda: results)
    assert results == [Ended(None, "up\n")]
    system.stop_kept()
    until(loop, lambda: not loop._sources)


def test_one_that_ends_before_it_said_what_is_waited_for_is_an_error(loop):
    results = []
    System(Machine()).run(
        loop, Run(("sh", "-c", "echo no lease; exit 1"), 5.0, "obtained"), results.append, lambda: None
    )
    until(loop, lambda: results)
    assert isinstance(results[0], StepError)


def test_counters_of_a_device_are_read_and_absent_ones_are_none(tmp_path):
    folder = tmp_path / "class/net/wwan0/statistics"
    folder.mkdir(parents=True)
    (folder / "rx_packets").write_text("7\n")
    (folder / "tx_packets").write_text("9\n")
    system = System(Machine(sys=tmp_path))
    assert system.counters("wwan0") == (7, 9)
    assert system.counters("usb0") is None


def test_nothing_of_a_tool_stays_open(loop):
    before = len(os.listdir("/proc/self/fd"))
    _, said = run(loop, "true")
    until(loop, lambda: said)
    assert len(os.listdir("/proc/self/fd")) == before


def test_default_routes_are_those_of_the_device_with_a_gateway(tmp_path):
    head = "Iface\tDestination\tGateway\tFlags\tRefCnt\tUse\tMetric\tMask\tMTU\tWindow\tIRTT\n"
    rows = [
        ("wwan0", "00000000", "0101400A", "0003", 0, 0, 700, "00000000"),
        ("wwan0", "0001400A", "00000000", "0001", 0, 0, 0, "00FFFFFF"),
        ("eth0", "00000000", "0202000A", "0003", 0, 0, 0, "00000000"),
        ("wwan0", "00000000"),
    ]
    (tmp_path / "net").mkdir()
    table = tmp_path / "net/route"
    table.write_text(head + "".join("\t".join(map(str, row)) + "\n" for row in rows[:3]))
    system = System(Machine(proc=tmp_path))
    assert system.default_routes("wwan0") == [Route("10.64.1.1", 700)]
    assert system.default_routes("usb0") == []
    table.write_text(head + "\t".join(rows[3]))
    assert system.default_routes("wwan0") == []
    table.unlink()
    assert system.default_routes("wwan0") == []


def test_a_tool_whose_end_nobody_would_see_is_not_left_behind(loop, monkeypatch):
    started = []

    def refused(pid):
        started.append(pid)
        raise OSError(errno.EMFILE, "Too many open files")

    before = len(os.listdir("/proc/self/fd"))
    monkeypatch.setattr(os, "pidfd_open", refused)
    with pytest.raises(InterfaceError, match="Too many open files"):
        run(loop, "sleep", "97")
    with pytest.raises(ChildProcessError):
        os.waitpid(started[0], os.WNOHANG)
    assert len(os.listdir("/proc/self/fd")) == before
