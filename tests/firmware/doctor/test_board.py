"""The doctor on a board file: what it names is looked for on the machine, and nothing is switched."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from board.machine import Machine
from drivers.sim.machine import SimulatedDevice, SimulatedMachine
from drivers.udp.driver import UdpOptions
from firmware import cli
from firmware.config import board_file
from firmware.config.board_file import Board
from firmware.config.captain_toml import InterfaceConfig
from firmware.config.tables import QueueOptions
from firmware.doctor import board as board_checks
from firmware.doctor.finding import Finding, Level
from tests.said import tells

TEXT = """
name = "mine"
[slots.gnss]
usb = "1-1.1"
[slots.v2x]
usb = "1-1.3"
"""
GNSS = InterfaceConfig("gnss", QueueOptions("udp", slot="gnss"), UdpOptions(listen="127.0.0.1:0"))


@pytest.fixture
def simulated(tmp_path: Path) -> Iterator[SimulatedMachine]:
    machine = SimulatedMachine(tmp_path)
    yield machine
    machine.close()


def board_of(folder: Path, text: str) -> Board:
    (folder / "mine.toml").write_text(text)
    return board_file.load(str(folder / "mine.toml"))


def problems(board: Board, machine: Machine) -> list[Finding]:
    return [found for found in board_checks.board(board, machine) if found.level is not Level.OK]


@pytest.fixture(autouse=True)
def root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(board_checks.os, "geteuid", lambda: 0)


def test_a_board_whose_hub_is_there_is_well(tmp_path: Path, simulated: SimulatedMachine) -> None:
    board = board_of(tmp_path, TEXT)
    (told,) = board_checks.board(board, simulated.machine)
    assert (told.level, told.text) == (Level.OK, "mine: 2 slots")


def test_hub_that_is_absent_is_a_warning_with_lsusb(tmp_path: Path, simulated: SimulatedMachine) -> None:
    board = board_of(tmp_path, TEXT.replace("1-1.", "1-2."))
    (told,) = problems(board, simulated.machine)
    assert told.level is Level.WARNING
    assert tells(told.text, "USB hub", "1-2")
    assert "lsusb -t" in told.remedy


def test_a_bus_that_is_not_there_is_a_problem(tmp_path: Path, simulated: SimulatedMachine) -> None:
    board = board_of(tmp_path, TEXT + f'[buses.main]\npath = "{tmp_path}/i2c-1"\n')
    (told,) = problems(board, simulated.machine)
    assert (told.level, told.subject) == (Level.PROBLEM, "bus main")
    assert "dtparam=i2c_arm=on" in told.remedy
    (tmp_path / "i2c-1").touch()
    assert problems(board, simulated.machine) == []


def test_lines_on_a_machine_without_gpio_are_a_problem(tmp_path: Path, simulated: SimulatedMachine) -> None:
    board = board_of(tmp_path, TEXT + '[lines.power]\nline = "GPIO17"\n')
    (told,) = problems(board, simulated.machine)
    assert (told.level, told.subject) == (Level.PROBLEM, "lines")


def test_slots_that_only_root_may_switch_are_a_warning_for_other_users(
    tmp_path: Path, simulated: SimulatedMachine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(board_checks.os, "geteuid", lambda: 1000)
    (told,) = problems(board_of(tmp_path, TEXT), simulated.machine)
    assert told.level is Level.WARNING
    assert tells(told.text, "gnss, v2x: ", "root", "USB")


def test_what_sits_in_a_slot_is_named(tmp_path: Path, simulated: SimulatedMachine) -> None:
    board = board_of(tmp_path, TEXT)
    (empty,) = board_checks.slot_of(GNSS, board, simulated.machine)
    assert (empty.level, empty.text) == (Level.WARNING, "no USB device at 1-1.1 now")
    simulated.plug("1-1.1", SimulatedDevice("1546", "01a9"))
    (found,) = board_checks.slot_of(GNSS, board, simulated.machine)
    assert (found.level, found.text) == (Level.OK, "1546:01a9 at 1-1.1")


def test_the_simulated_board_is_well_for_the_doctor(block: int, capsys: pytest.CaptureFixture[str]) -> None:
    keys = ("from_users", "to_users", "pull", "report")
    ports = [word for at, key in enumerate(keys) for word in ("--set", f"endpoint.{key}={block + at}")]
    assert cli.main(["doctor", "--board", "sim", *ports]) == 0
    assert "slot v2x: som301e: simulated; `captain selftest` tries it" in capsys.readouterr().out
