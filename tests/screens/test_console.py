"""Screen of captain console on an emulated VT100."""

import time

import pytest

from tests.firmware.console.conftest import bench, block, machine, status
from tests.firmware.console.emulated import Bench
from tests.screens.terminal import compare

__all__ = ["bench", "block", "machine", "status"]


def test_the_status_of_a_station_is_one_screen(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "time", lambda: 1_795_371_460.0)
    bench.start_station()
    bench.open()
    bench.until_shown("captain  captain 0.1.0", within=3.0)
    compare("console", [line.rstrip() for line in bench.terminal.lines[:23]])
