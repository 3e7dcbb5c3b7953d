"""Everything fails at random for minutes of virtual time, and a station stays what it is."""

import os
import re
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.sim.modules import MODEM, RADIO, RECEIVER
from drivers.sim.trouble import BOARD, TROUBLE
from drivers.sim8202g.step import BRING_UP, words
from tests.proof.chaos import limits
from tests.proof.chaos.stage import INTERFACES, Stage
from tests.proof.chaos.virtual import VirtualRun

# `make chaos` runs 30 minutes of each of many.
MINUTES = float(os.environ.get("CHAOS_MINUTES", "2"))
SEEDS = range(1, 1 + int(os.environ.get("CHAOS_COUNT", "3")))
ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_station_routes_on_and_brings_every_module_back(seed: int, tmp_path: Path, monkeypatch) -> None:
    run = VirtualRun(seed, MINUTES, tmp_path, monkeypatch)
    try:
        goals = run.play()
    finally:
        run.stage.close()
    assert [f"{goal.what}: {goal.seen}" for goal in goals if not goal.is_met] == []


@pytest.mark.parametrize(
    ("what", "seconds"),
    [
        ("GNSS receiver", limits.MODULES_S[RECEIVER]),
        ("SOM301-E", limits.MODULES_S[RADIO]),
        ("SIM8202G", limits.MODULES_S[MODEM]),
        ("the board's readings", limits.BOARD_S),
    ],
)
def test_the_documented_times_are_those_of_the_code(what: str, seconds: float) -> None:
    rows = [line.split("|") for line in (ROOT / "board/README.md").read_text().splitlines() if line.startswith("| ")]
    (row,) = [row for row in rows if row[1].strip() == what]
    assert row[2].strip() == f"{seconds:.0f} s"
    assert sum(map(float, re.findall(r"(\d+) s", row[3]))) == pytest.approx(seconds)


@pytest.fixture
def stage(tmp_path: Path, monkeypatch) -> Iterator[Stage]:
    stage = Stage(tmp_path, monkeypatch, 1)
    yield stage
    stage.close()


def test_from_power_on_the_time_line_names_what_each_module_waits_for(stage: Stage) -> None:
    stage.start()
    stage.loop.run_until(lambda: all(stage.is_up(name) for name in (*INTERFACES, BOARD)), 30.0)
    told = [(str(note["who"]), str(note["what"])) for note in stage.station.timeline.status()]
    for slot, described in stage.station.config.board.slots.items():
        if described.ids:
            waits = f"powering: the station has started; waits for {described.ids[0]} at {described.usb}"
            assert [what for who, what in told if who == f"slot {slot}"] == [
                waits,
                f"starting: {described.ids[0]}",
                "running: driver started; waits for its link",
            ]
    steps = [what for who, what in told if who == "cellular"]
    walk = [words(step) for step in BRING_UP]
    walk.insert(walk.index(words("sim")) + 1, words("sim", "busy"))
    walk.insert(walk.index(words("registration")) + 1, words("registration", "searching"))
    assert steps == [*(f"starting: {step}" for step in walk), "up: 10.64.1.2"]


def test_trouble_from_outside_is_answered(stage: Stage) -> None:
    stage.start()
    door = stage.folder / TROUBLE
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as voice:
        voice.bind("")  # a name of the kernel's
        answers = []
        for text in ("begin cellular silent", "end cellular silence"):
            voice.sendto(text.encode(), str(door))
            stage.loop.run_for(0.01)
            answers.append(voice.recv(1000).decode())
    assert answers[0] == "ok"
    assert answers[1].startswith("unknown trouble: 'end cellular silence'")
    assert "garbage, silent, refusing, uncovered, cardless" in answers[1]


def test_a_real_board_listens_to_nobody_who_brings_trouble() -> None:
    files = (path for folder in ("board", "drivers", "firmware") for path in (ROOT / folder).rglob("*.py"))
    users = [path for path in files if "sim.trouble" in path.read_text()]
    assert [str(path.relative_to(ROOT)) for path in users] == ["drivers/sim/board.py"]
