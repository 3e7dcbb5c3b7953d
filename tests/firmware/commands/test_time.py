"""captain time: what is shown of a station's clock, and what is drawn."""

import argparse
import json
import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from board.runtime.errors import StationError, UsageError
from firmware.client.show.status.clock import duration, title
from firmware.client.show.status.clock import table as clock_table
from firmware.client.show.table import plain
from firmware.client.show.time_record import Record
from firmware.clock.time_history import SecondRow, TimeHistory
from firmware.commands import time
from tests.firmware.commands.fake import FakeControl

CLOCK: dict[str, Any] = {
    "state": "holdover",
    "offset_ns": -111_159,
    "uncertainty_ns": 5_190,
    "jitter_ns": 596,
    "frequency_ppb": -12_345.67,
    "skew_ppb": 2.13,
    "age_s": 12.6,
    "error_ns": 116_349,
    "its_ms": 722_454_248_771,
    "leap": {
        "table": "/usr/share/zoneinfo/leap-seconds.list",
        "expires": 1_798_243_200,
        "doubt": "",
        "seconds": 5,
        "event": {"its_s": 725_846_405, "change": 1, "utc": "2026-12-31T23:59:60.000Z"},
    },
    "receiver": "gnss",
    "pulse": {
        "input": "/dev/pps0",
        "is_open": True,
        "why": "",
        "hint": "",
        "failures": 0,
        "age_s": 12.6,
        "taken": 3600,
        "missed": 2,
        "extra": 1,
        "seconds": 3590,
        "late": 4,
        "surprises": 1,
        "refused": [
            {"reason": "acquiring", "meaning": "good as far as is known", "count": 3, "time": 1.0, "detail": "3 of 4"},
            {"reason": "unlocked", "meaning": "no satellites", "count": 5, "time": 1.0, "detail": "second 722454236"},
        ],
    },
    "refclock": {
        "path": "/run/chrony.captain.sock",
        "feeds": False,
        "why": "there is no socket",
        "samples": {"sent": 3000, "absent": 12},
    },
    "tracking": {
        "why": "",
        "stratum": 1,
        "reference": "PPS",
        "system_offset_s": 1.2e-7,
        "frequency_ppm": 12.346,
        "leap": "Insert second",
    },
    "missing": "",
}
SHOWN = """\
time holdover: no good pulse recently: the oscillator continues, within 5.19 us
what          value
ITS time      722454248771 ms, 2026-11-22 17:44:03 UTC
system clock  111 us ahead; time stamps are within 116 us
oscillator    runs 12.3457 ppm slow, +-0.0021 ppm
leap seconds  5 since 2004 by leap-seconds.list until 2026-12-26
              announced: +1 at 2026-12-31T23:59:60.000Z
receiver      gnss
pulses        /dev/pps0, the last 13 s ago
              3600 taken, 3590 good, 2 missed, 1 too many, 4 late, 8 refused
chronyd       is not fed: 3000 samples sent, 12 absent
              stratum 1 by PPS, offset 120 ns, 12.346 ppm, leap Insert second
  chronyd is not fed: there is no socket
  once pulses came back and the time was further off than had been stated
  refused 5 times, unlocked: no satellites; the last: second 722454236"""


def history(count: int = 100) -> TimeHistory:
    made = TimeHistory()
    for second in range(count):
        offset_ns = 100.0 * (second % 10)
        made.add(SecondRow(722_454_180.0 + second, offset_ns, 5000.0, 600.0 + second, 3.0 * second + second % 2))
    return made


def run(folder: Path, *words: str, clock: object = CLOCK, kept: TimeHistory | None = None) -> int:
    answer = {"ok": True, "clock": clock, "history": (kept or history()).told() if clock is CLOCK else {}}
    parser = argparse.ArgumentParser()
    time.arguments(parser)
    with FakeControl(folder / "control", json.dumps(answer).encode() + b"\n") as control:
        return time.main(parser.parse_args([*words, "--control", str(control.path)]))


def test_all_that_a_station_says_fits_a_terminal() -> None:
    assert "\n".join(plain(clock_table(CLOCK), 80)) == SHOWN


def test_the_last_hour_is_two_lines_of_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(tmp_path) == 0
    *_, head, _, offset, jitter = capsys.readouterr().out.rstrip().splitlines()
    assert head.startswith("the last 99 s")
    assert offset.startswith("offset  ")
    assert offset.endswith("  0.0 .. 0.9")
    assert jitter.startswith("jitter  ")
    assert len(offset) <= 80


@pytest.mark.parametrize(
    ("clock", "said"),
    [
        ({}, "time unknown: no source"),
        ({"state": "system", "missing": "no interface announces pulses"}, "time system: the system's clock alone"),
        ({"state": 5, "pulse": 7, "leap": [], "offset_ns": "x", "its_ms": 1e300}, "time unknown: no source"),
        ({"state": "fine\x1b"}, "time fine\\x1b: a state of another version"),
    ],
)
def test_what_a_station_leaves_out_or_writes_otherwise_is_not_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], clock: dict[str, object], said: str
) -> None:
    assert run(tmp_path, clock=clock) == 0
    assert capsys.readouterr().out.splitlines()[0] == said


def test_what_is_missing_is_said_with_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pulse = {"input": "/dev/pps0", "is_open": False, "why": "/dev/pps0: No such file", "hint": "load the overlay"}
    run(tmp_path, clock={"state": "coarse", "pulse": pulse})
    assert "no pulses: /dev/pps0: No such file (load the overlay)" in capsys.readouterr().out


def test_json_is_the_clock_and_the_history_where_it_is_wanted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run(tmp_path, "--json")
    assert json.loads(capsys.readouterr().out) == CLOCK
    (tmp_path / "control").unlink()
    run(tmp_path, "--json", "--history")
    told = json.loads(capsys.readouterr().out)["history"]
    assert (len(told["seconds"]), told["seconds"][7]["offset_ns"], len(told["minutes"])) == (100, 700.0, 1)


def test_a_plot_is_one_svg_that_asks_nobody_for_anything(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "time.svg"
    assert run(tmp_path, "--plot", str(path)) == 0
    assert capsys.readouterr().out == f"{path}: 100 seconds and 1 minutes\n"
    drawn = path.read_text()
    assert ElementTree.fromstring(drawn).tag == "{http://www.w3.org/2000/svg}svg"
    assert set(re.findall(r"https?:[^\s\"'<>]*", drawn)) == {"http://www.w3.org/2000/svg"}
    assert not re.search(r"<script|@import|url\(|href|<!--", drawn)
    for words in ("Allan deviation", "jitter: standard deviation", "time holdover"):
        assert words in drawn


def test_a_plot_of_what_is_mostly_unknown_is_drawn(tmp_path: Path) -> None:
    kept = TimeHistory()
    for second in range(3):
        kept.add(SecondRow(722_454_180.0 + second, 5.0, math.nan, math.nan, math.nan))
    assert run(tmp_path, "--plot", str(tmp_path / "time.svg"), kept=kept) == 0


@pytest.mark.parametrize(("name", "said"), [("time.png", "a picture is SVG"), ("none/time.svg", "cannot be written")])
def test_a_plot_that_cannot_be_is_refused(tmp_path: Path, name: str, said: str) -> None:
    with pytest.raises(StationError, match=said) as caught:
        run(tmp_path, "--plot", str(tmp_path / name))
    assert isinstance(caught.value, UsageError) is name.endswith("png")


def test_plot_without_a_history_is_refused_with_what_the_clock_lacks(tmp_path: Path) -> None:
    with pytest.raises(StationError, match="no history") as caught:
        run(tmp_path, "--plot", str(tmp_path / "a.svg"), clock={"missing": "no [pulse]"})
    assert caught.value.hint == "no [pulse]"


def test_where_no_station_runs_it_is_said_what_to_do(tmp_path: Path) -> None:
    parser = argparse.ArgumentParser()
    time.arguments(parser)
    with pytest.raises(StationError, match="no station answers") as caught:
        time.main(parser.parse_args(["--control", str(tmp_path / "none")]))
    assert "captain run" in caught.value.hint


@pytest.mark.parametrize(
    ("ns", "said"),
    [
        (0, "0 ns"),
        (999, "999 ns"),
        (1000, "1 us"),
        (5190, "5.19 us"),
        (-111_159, "-111 us"),
        (999_600, "1 ms"),
        (3.7e9, "3.7 s"),
        (86_400e9, "86400 s"),
    ],
)
def test_a_duration_has_three_figures(ns: float, said: str) -> None:
    assert duration(ns) == said


def test_the_title_says_the_bound_where_there_is_one() -> None:
    assert title({"state": "locked", "uncertainty_ns": 0}) == "time locked: set by pulses, within 0 ns"


def kept_of(*phases: float | None) -> list[SecondRow]:
    """A second each; None: no pulse."""
    nan = math.nan
    return [SecondRow(1000.0 + at, 0.0, 0.0, 0.0, nan if phase is None else phase) for at, phase in enumerate(phases)]


@pytest.mark.parametrize(
    ("phases", "stretch"),
    [
        ((), []),
        ((None, None), []),
        ((0, 1, 2), [0, 1, 2]),
        ((0, 1, None, 3, 4), [0, 1, 2, 3, 4]),
        ((0, 1, None, None, None, 8), [0, 1, 2.75, 4.5, 6.25, 8]),
        ((0, 1, None, None, None, None, 7, 8, 9), [7, 8, 9]),
        ((0, 1, 2, None, None, None, None, 7), [0, 1, 2]),
    ],
)
def test_the_allan_deviation_is_of_the_longest_stretch_of_pulses(phases: Any, stretch: list[float]) -> None:
    assert time.longest(kept_of(*phases), 1) == stretch


def test_lengths_beyond_those_of_seconds_are_of_minutes() -> None:
    seconds = [SecondRow(float(at), 0.0, 0.0, 0.0, float(at % 3)) for at in range(400)]
    minutes = [SecondRow(60.0 * at, 0.0, 0.0, 0.0, float(at % 3)) for at in range(400)]
    lengths = [tau_s for tau_s, _ in time.deviations(Record(seconds, minutes))]
    assert lengths == [1, 2, 4, 8, 16, 32, 64, 120, 240, 480, 960, 1920, 3840]


@pytest.mark.parametrize(
    "words", [["--history"], ["--plot", "a.svg", "--json"], ["--plot", "a.svg", "--watch"], ["--plot", ""]]
)
def test_options_of_which_one_would_be_ignored_are_refused(words: list[str]) -> None:
    parser = argparse.ArgumentParser()
    time.arguments(parser)
    with pytest.raises(UsageError):
        time.main(parser.parse_args(words))


def test_a_terminal_of_24_lines_has_room_for_all_that_is_wrong() -> None:
    reasons = ("unlocked", "utc", "disagree", "trailing")
    refused = [{"reason": one, "meaning": "m" * 60, "count": 5 + at, "detail": "d"} for at, one in enumerate(reasons)]
    shown = clock_table({**CLOCK, "pulse": {**CLOCK["pulse"], "refused": refused}})
    lines = [line for one in (shown, *time.lines(Record(kept_of(*range(60)), []), "ab")) for line in plain(one, 80)]
    assert len(lines) <= 23
    assert lines[0].startswith("time holdover")
    assert any("refused 11 times for others: utc, unlocked" in line for line in lines)
