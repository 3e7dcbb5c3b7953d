"""The live table of a tap, on a terminal of 80 columns and 24 lines."""

import re
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.reason import Reason
from drivers.wire.v2n.message import Delivery, RefusedError
from firmware.client.show.table import Screen, Table, plain
from firmware.tap.counts import Counts, Taken
from firmware.tap.display import Display
from tests.screens.terminal import Terminal

CAM = bytes.fromhex("02020000053900010203")


class Noting(Screen):
    """Keeps what it is asked to show."""

    def show(self, tables: Any) -> None:
        self.shown: list[Table] = list(tables)


class Bench:
    def __init__(self, screen: Noting) -> None:
        self.screen = screen
        self.counts = Counts()
        self.connection: Any = SimpleNamespace(is_up=True, broker="mqtt://localhost:1883")
        self.display = Display(screen, self.counts, self.connection)

    def take(self, station: int) -> None:
        pdu = CAM[:2] + station.to_bytes(4) + CAM[6:]
        self.display.add(Taken(pdu, 2001, "vm", "v2x/btp/2001", 0))

    def lines(self, is_last: bool = False) -> list[str]:
        self.display.draw(self.counts.started + 2.0, is_last)
        return [line for table in self.screen.shown for line in plain(table, 80)]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    for name, value in (("TERM", "xterm"), ("LINES", "24"), ("COLUMNS", "80")):
        monkeypatch.setenv(name, value)
    with Noting(Terminal()) as screen:
        yield Bench(screen)


def test_what_has_no_room_is_told_as_a_row_of_others(bench: Bench) -> None:
    for station in range(100):
        bench.take(station)
    bench.counts.refuse(RefusedError(Reason.PAYLOAD, "no base64 " * 20), Delivery("t", b"x" * 32, False))
    lines = bench.lines()
    assert len(lines) <= bench.screen.height == 23
    rows = [line for line in lines if re.match(r"cam +\d+", line)]
    (others,) = re.findall(r"^ +others +(\d+)", "\n".join(lines), re.MULTILINE)
    assert int(others) == 100 - len(rows)


def test_a_tap_that_is_done_does_not_say_that_it_lost_its_broker(bench: Bench) -> None:
    bench.connection.is_up = False
    assert "not connected" in " ".join(bench.lines())
    assert "not connected" not in " ".join(bench.lines(is_last=True))
