"""Report: a page without requests, JSON, GeoJSON, tables of 80 columns."""

import json
import re
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from board.runtime.errors import StationError
from drivers.message import Position
from firmware.client.show.table import plain
from firmware.meter.event import ReceivedEvent, Sent
from firmware.meter.meter import Meter
from firmware.meter.report import page
from firmware.meter.report.drawing import drawn, end_of, mapped, strength, ticks
from firmware.meter.report.plot import Plot, Series, plots
from firmware.meter.report.text import of_us, tables
from firmware.meter.result import About, distribution, result
from firmware.meter.sample import Sample
from tests.firmware.meter.events import received, sent
from tests.firmware.meter.test_figures import BOTH, metered

# Of the package uplot 1.6.32 in the npm registry, whose integrity is
# sha512-KIMVnG68zvu5XXUbC4LQEPnhwOxBuLyW1AHtpm6IKTXImkbLgkMy+jabjLgSLMasNuGGzQm/ep3tOkyTxpiQIw==
UPLOT = {
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
    "uPlot.LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
}
VOID = {"meta", "br", "path", "circle", "rect"}


class Page(HTMLParser):
    """Elements that are opened and not closed, and what would be fetched."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []
        self.tags: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.fetched += [f"{name}={value}" for name, value in attrs if name in ("src", "href", "action", "data")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag


@pytest.fixture(scope="module")
def measured() -> dict[str, Any]:
    """Two ways for ten seconds, some lost, with places."""
    meter = Meter(grace_s=0.5)
    for name in "AB":
        meter.station(name, BOTH)
    events: list[Sent | ReceivedEvent] = []
    for n in range(100):
        meter.spots.note_message(str(n), Position(480_000_000 + 200 * n, 110_000_000 + 300 * n))
        for by, delay_s in (("g5", 0.004), ("v2n", 0.03)):
            events.append(sent(n, n * 0.1, by=by))
            if n % 7 or by == "v2n":
                events.append(received(n, n * 0.1 + delay_s, by=by)._replace(rssi_dbm=-60 - n // 3))
    metered(*events, meter=meter)
    clock = [{"at_s": float(at), "state": "locked", "offset_ns": 100, "uncertainty_ns": 5000} for at in range(10)]
    stations = {name: {"where": "127.0.0.1:5555", "clock": clock, "notes": ["<b>no</b>"]} for name in "AB"}
    return result(meter, About("a title with <tags>", "in a test", 0.0, 10.0, stations, ("a & b",)))


def test_the_page_is_whole_and_fetches_nothing(measured: dict[str, Any]) -> None:
    text = page.page(measured)
    read = Page(text)
    assert (read.open, read.fetched) == ([], [])
    assert "url(" not in text
    assert not re.search(r"@import|<link|<iframe|fetch\(|XMLHttpRequest", text)
    assert "default-src 'none'" in text
    assert {"svg", "table", "figure"} <= set(read.tags)


def test_what_a_station_says_is_text_and_nothing_else(measured: dict[str, Any]) -> None:
    text = page.page({**measured, "title": "</script><script>alert(1)</script>"})
    assert "<script>alert" not in text
    assert "<b>no</b>" not in text


def test_the_numbers_of_the_script_cannot_end_it(measured: dict[str, Any]) -> None:
    hostile = json.loads(json.dumps(measured).replace("A > B g5", "</script><script>x"))
    assert "</script><script>x" not in page.page(hostile)


def test_the_library_is_the_one_that_was_looked_at() -> None:
    assert {name: sha256((page.ASSETS / name).read_bytes()).hexdigest() for name in UPLOT} == UPLOT


def test_three_files_are_written_side_by_side(measured: dict[str, Any], tmp_path: Path) -> None:
    paths = list(page.write(measured, tmp_path / "drive.html"))
    assert [path.name for path in paths] == ["drive.html", "drive.json", "drive.geojson"]
    assert json.loads(paths[1].read_text()) == json.loads(json.dumps(measured))
    features = json.loads(paths[2].read_text())["features"]
    assert len(features) == 200
    assert features[0]["geometry"]["coordinates"] == [11.0, 48.0]
    assert sum(feature["properties"]["is_lost"] for feature in features) == 15


def test_a_folder_that_is_not_there_is_told(measured: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(StationError, match="No such file"):
        list(page.write(measured, tmp_path / "nowhere" / "drive.html"))


def test_every_table_fits_into_80_columns(measured: dict[str, Any]) -> None:
    for table in tables(measured):
        assert max(map(len, plain(table, 80, cuts=False))) <= 80, table.title


def test_of_nothing_there_is_a_page_as_well() -> None:
    empty = result(Meter(), About("nothing", "in a test", 0.0, 0.0, {}))
    assert Page(page.page(empty)).open == []
    assert list(plots(empty)) == []


def test_a_plot_has_a_line_for_each_way(measured: dict[str, Any]) -> None:
    found = {plot.key: plot for plot in plots(measured)}
    assert {"loss", "delay", "gap", "rssi", "delays cumulative", "clocks"} <= set(found)
    assert [one.name for one in found["loss"].series] == ["A > B g5", "A > B v2n"]
    assert found["delays cumulative"].series[0].values[-1] == 100.0


def test_a_distribution_of_gaps_tells_milliseconds_apart() -> None:
    gaps = Sample()
    for n in range(1000):
        gaps.add(0.1 + n % 10 * 0.001)
    found = distribution(gaps)
    assert found is not None
    bars = found["bars"]
    assert isinstance(bars, list)
    assert sum(bars) == 1000
    assert sum(bar > 0 for bar in bars) == 10


def test_a_distribution_counts_all_though_not_all_are_kept() -> None:
    sample = Sample(most=100)
    for n in range(1000):
        sample.add(n)
    found = distribution(sample)
    assert found is not None
    assert 950 <= sum(found["bars"]) + found["above"] <= 1050  # type: ignore[call-overload, operator]


def test_a_glance_has_the_tables_of_the_whole(measured: dict[str, Any]) -> None:
    meter = Meter(grace_s=0.5)
    for name in "AB":
        meter.station(name, BOTH)
    metered(sent(1, 0.0, by="g5"), received(1, 0.1, by="g5"), meter=meter)
    about = About("glance", "in a test", 0.0, 1.0, {})
    whole, glance = (list(tables(result(meter, about, is_glance=one))) for one in (False, True))
    assert glance == whole


def test_a_gap_in_a_line_is_drawn_as_one() -> None:
    plot = Plot("x", "x", "s", "ms", "ms", [0.0, 1.0, 2.0, 3.0], [Series("a", "#000000", [1.0, None, 2.0, 3.0])])
    line = drawn(plot).rpartition('<path d="')[2]
    assert line.count("M") == 2


@pytest.mark.parametrize(
    ("low", "high", "expected"), [(0, 10, [0, 2, 4, 6, 8, 10]), (-92, -55, [-90, -80, -70, -60]), (3, 3, [3])]
)
def test_ticks_are_round_numbers(low: float, high: float, expected: list[float]) -> None:
    assert ticks(low, high) == expected


def test_a_map_is_of_the_end_that_moves() -> None:
    def spots(sender_step: float, receiver_step: float | None) -> list[dict[str, Any]]:
        return [
            {
                "sender": [48 + n * sender_step, 11],
                "receiver": None if receiver_step is None else [48, 11 + n * receiver_step],
            }
            for n in range(3)
        ]

    assert end_of(spots(0.0, 0.01)) == "receiver"
    assert end_of(spots(0.01, 0.01)) == "sender"
    assert end_of(spots(0.0, 0.0)) == "sender"
    assert end_of(spots(0.0, None)) == "sender"
    assert end_of([*spots(0.0, 0.01), *spots(0.0, None)]) == "receiver"
    assert (
        mapped([spot | {"is_lost": False, "rssi_dbm": None} for spot in (*spots(0.0, 0.01), *spots(0.0, None))]).count(
            "<circle"
        )
        == 3
    )


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [(0.0001, "5 m"), (0.001, "50 m"), (0.01, "500 m"), (0.1, "5 km"), (1.0, "50 km"), (60.0, "2000 km")],
)
def test_a_map_of_any_extent_has_a_bar_of_a_length_that_is_read_off(degrees: float, expected: str) -> None:
    drive = [{"sender": [48 + at, 11.0], "receiver": None, "is_lost": False, "rssi_dbm": None} for at in (0.0, degrees)]
    (bar,) = re.findall(r'<text x="22"[^>]*>([^<]*)</text>', mapped(drive))
    assert bar == expected
    (length,) = re.findall(r"v6h([0-9.]+)v-6", mapped(drive))
    assert 40 < float(length) <= 200


def test_a_strength_has_a_colour_and_none_is_grey() -> None:
    assert len({strength(rssi) for rssi in (-100, -90, -80, -70, -60, -50, None)}) == 6


@pytest.mark.parametrize(
    ("us", "expected"), [(12.3, "12 us"), (1234.0, "1.23 ms"), (2_500_000.0, "2.500 s"), (-30.0, "-30 us")]
)
def test_a_duration_is_told_in_its_own_unit(us: float, expected: str) -> None:
    assert of_us(us) == expected
