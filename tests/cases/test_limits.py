"""A station with a clock beyond 2143, and one that may open few files."""

import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.system.conftest import Launcher
from tests.system.station import PATIENCE, ROOT

YEAR_S = 31_557_600
# Imported by Python at its start: the station, and the processes that it starts, have a clock so many seconds ahead.
AHEAD = """\
import os, time

shift = int(os.environ["AHEAD_S"])
now, now_ns, clock, clock_ns = time.time, time.time_ns, time.clock_gettime, time.clock_gettime_ns
time.time = lambda: now() + shift
time.time_ns = lambda: now_ns() + shift * 10**9
time.clock_gettime = lambda which: clock(which) + shift * (which == time.CLOCK_REALTIME)
time.clock_gettime_ns = lambda which: clock_ns(which) + shift * 10**9 * (which == time.CLOCK_REALTIME)
"""


@pytest.fixture
def launch(tmp_path: Path) -> Iterator[Launcher]:
    launcher = Launcher(lambda: tmp_path)
    yield launcher
    launcher.close()


@pytest.mark.parametrize("years", [30, 90, 130, 200])  # 2038, 2106, 2143: numbers of 31, 32 and 42 bits end
def test_a_simulated_board_whose_clock_is_far_ahead_goes_on(
    launch: Launcher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, years: int
) -> None:
    (tmp_path / "sitecustomize.py").write_text(AHEAD)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("AHEAD_S", str(years * YEAR_S))
    station = launch.station()
    station.configure({}, recorder={"folder": str(tmp_path / "ring"), "in_memory": True})
    station.start("--board", "sim")

    def is_at_work(status: dict[str, Any]) -> bool:
        return status["interfaces"]["g5"]["received"].get("cam", 0) > 20 and status["recorder"].get("frames", 0) > 20

    status = station.until(is_at_work)
    assert status["is_clock_set"] is (years < 117)
    assert ("later than the last ITS time, in 2143" in station.stderr.read_text()) is (years > 117)


@pytest.mark.parametrize("most", [8, 12, 20, 26, 63])
@pytest.mark.parametrize("board", ["none", "sim"])
def test_a_station_that_may_open_few_files_says_so_and_ends(most: int, board: str) -> None:
    run = [sys.executable, "-m", "firmware", "run", "--board", board]
    ended = _with_few_files(run, most)
    assert ended.returncode == 1
    assert ended.stderr == (
        f"captain: file descriptors: hard limit {most} is too low; a station needs 64\n"
        "  (raise the hard limit: LimitNOFILE=1024 in the unit, or nofile in /etc/security/limits.conf)\n"
    )


def test_a_command_that_may_open_few_files_says_so_and_ends() -> None:
    ended = _with_few_files([sys.executable, "-m", "firmware", "lab"], 10)
    assert ended.returncode == 1
    assert ended.stderr.startswith("captain: out of file descriptors: the limit of this process is 10\n")


def _with_few_files(command: list[str], most: int) -> subprocess.CompletedProcess[str]:
    limit = lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))  # noqa: E731
    return subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE, check=False, preexec_fn=limit
    )
