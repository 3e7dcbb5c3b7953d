"""Screens of captain listen: few stations, a busy junction, keys, messages that do not decode."""

import time
from types import SimpleNamespace
from typing import Any

import pytest

from captain_client.reception import Reception, Tally
from drivers.message import Implausible, RxInfo
from drivers.sim import messages
from drivers.sim.track import Motion
from firmware.client.received import Delivered
from firmware.client.show.table import Screen
from firmware.codec.decoding import Decoder
from firmware.codec.library import load
from firmware.codec.live import Live
from tests.firmware.commands.fake import delivered
from tests.screens.terminal import Terminal, compare

START = 1000.0


class Bench:
    """A live table under a clock of its own: add() hears stations once, draw() shows the moment."""

    def __init__(self, screen: Screen, monkeypatch: pytest.MonkeyPatch, is_decoded: bool = True) -> None:
        self.now = START
        monkeypatch.setattr(time, "monotonic", lambda: self.now)
        monkeypatch.setattr(time, "strftime", lambda _form: "12:00:00")
        listening: Any = SimpleNamespace(address="127.0.0.1:5558", started=START, silent_s=0)
        self.live = Live(screen, listening, Delivered(), Decoder(load()) if is_decoded else None, has_keys=True)

    def hear(self, kind: str, station: int, pdu: bytes = b"", implausible: tuple[Implausible, ...] = ()) -> None:
        motion = Motion(487_660_000 + station * 100, 114_310_000, 420_000, 20_280, 4_250_000)
        path = [motion] * (messages.TRACE + 1)
        made = messages.cam(station, 1000, motion) if kind == "cam" else messages.denm(station, 1000, path, 1)
        report = delivered(kind, pdu or made, rx=RxInfo(rssi_dbm=-70 - station % 20, implausible=implausible))
        message = Reception(Tally()).read(list(report))
        assert message is not None
        self.live.add(message)

    def second(self, kinds: dict[str, range], per_s: int = 2) -> None:
        """Each station is heard so many times in a second."""
        for _ in range(per_s):
            self.now += 1 / per_s
            for kind, stations in kinds.items():
                for station in stations:
                    self.hear(kind, station)
        self.live._tally.mark(self.now)


@pytest.fixture
def screen(terminal: Terminal) -> Screen:
    return Screen(terminal)


def shown(bench: Bench, terminal: Terminal) -> list[str]:
    bench.live.draw(bench.now)
    return terminal.lines()


def test_few_stations_are_on_one_screen(screen: Screen, terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(screen, monkeypatch)
    for _ in range(3):
        bench.second({"cam": range(4711, 4713), "denm": range(4711, 4712)})
    compare("listen", shown(bench, terminal))


def test_headers_alone_show_sizes(screen: Screen, terminal: Terminal, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(screen, monkeypatch, is_decoded=False)
    for _ in range(3):
        bench.second({"cam": range(4711, 4713), "denm": range(4711, 4712)})
    bench.hear("cam", 4711, implausible=(Implausible.TIME, Implausible.SOURCE))
    compare("listen-headers", shown(bench, terminal))


def test_messages_that_do_not_decode_are_explained_below(
    screen: Screen, terminal: Terminal, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(screen, monkeypatch)
    bench.second({"cam": range(4711, 4713)})
    bench.hear("cam", 1234, messages.cam(1234, 0, Motion(0, 0, 0, 0, 0))[:30])
    compare("listen-bad", shown(bench, terminal))


@pytest.fixture
def junction(screen: Screen, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """200 stations, three of which send DENMs."""
    bench = Bench(screen, monkeypatch)
    for _ in range(3):
        bench.second({"denm": range(1, 4), "cam": range(1, 201)})
    return bench


def test_200_stations_have_sums_and_the_first_rows(junction: Bench, terminal: Terminal) -> None:
    compare("listen-junction", shown(junction, terminal))


def test_rows_stay_whoever_is_heard_last(junction: Bench, terminal: Terminal) -> None:
    def stations() -> list[str]:
        return [line.split()[1] for line in shown(junction, terminal) if line.startswith("cam ")][1:]

    before = stations()
    junction.hear("cam", 200)
    junction.hear("cam", 150)
    assert stations() == before


def test_page_down_and_up_lead_to_the_next_rows_and_back(junction: Bench, terminal: Terminal) -> None:
    first = shown(junction, terminal)
    junction.live.press("page down", junction.now)
    compare("listen-junction-scrolled", terminal.lines())
    junction.live.press("page up", junction.now)
    assert terminal.lines() == first


@pytest.mark.parametrize(
    ("keys", "rows"),
    [
        (["down"], "rows 2 to 17 of 203"),
        (["down", "up", "up"], "rows 1 to 16 of 203"),
        (["end"], "rows 188 to 203 of 203"),
        (["end", "page down"], "rows 188 to 203 of 203"),
        (["end", "page up"], "rows 172 to 187 of 203"),
        (["page down", "home"], "rows 1 to 16 of 203"),
        (["unknown"], "rows 1 to 16 of 203"),
    ],
)
def test_keys_scroll_as_far_as_there_are_rows(junction: Bench, terminal: Terminal, keys: list[str], rows: str) -> None:
    shown(junction, terminal)
    for key in keys:
        junction.live.press(key, junction.now)
    assert rows in terminal.lines()[-1]


def test_the_uppermost_row_stays_while_another_comes_above(junction: Bench, terminal: Terminal) -> None:
    shown(junction, terminal)
    junction.live.press("page down", junction.now)
    before = [line.split()[:2] for line in terminal.lines()[6:-1]]
    junction.hear("denm", 9)
    after = shown(junction, terminal)
    assert [line.split()[:2] for line in after[6:-1]] == before
    assert "rows 18 to 33 of 204" in after[-1]
