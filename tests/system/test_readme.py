"""What the README shows works: its programs against a station, its configurations, its tables."""

import re
import select
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path

import pytest

from board import description
from drivers import DRIVERS
from drivers.reason import Reason
from drivers.sim.neighbours import NeighboursOptions
from firmware import config, tables
from firmware.topics import ROWS, TypeRow
from tests.system.conftest import Bench
from tests.system.station import PATIENCE, ROOT
from tests.system.user import JOIN_MS, mark

README = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
# The first line of a program is a comment with its name.
PROGRAMS = {code.split(maxsplit=2)[1].rstrip(":"): code for kind, code in BLOCKS if kind in ("python", "cpp")}
TOML = [code for kind, code in BLOCKS if kind == "toml"]
BOARDS = re.findall(r"^```toml board\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
HARDWARE = re.findall(r"^```toml hardware\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
LONGEST = 20  # lines that say something


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Name -> command, those in C++ compiled."""
    folder = tmp_path_factory.mktemp("readme")
    for name, code in PROGRAMS.items():
        (folder / name).write_text(code)
    compilers = [
        subprocess.Popen(
            ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", str(path), "-o", str(path.with_suffix("")), "-lzmq"]
        )
        for path in folder.glob("*.cpp")
    ]
    assert [compiler.wait() for compiler in compilers] == [0] * len(compilers)
    return {
        name: [sys.executable, str(folder / name)] if name.endswith(".py") else [str((folder / name).with_suffix(""))]
        for name in PROGRAMS
    }


@contextmanager
def running(command: list[str], address: str) -> Iterator["subprocess.Popen[bytes]"]:
    with subprocess.Popen([*command, address], stdout=subprocess.PIPE) as child:
        try:
            yield child
        finally:
            child.kill()


def test_there_are_the_programs_that_follow() -> None:
    assert set(PROGRAMS) == {"sender.py", "sender.cpp", "receiver.py", "receiver.cpp", "messages.py"}


@pytest.mark.parametrize("name", PROGRAMS)
def test_none_is_longer_than_20_lines(name: str) -> None:
    lines = [line for line in PROGRAMS[name].splitlines() if line.strip() and not line.startswith(("//", "# "))]
    assert len(lines) <= LONGEST


@pytest.mark.parametrize("name", ["sender.py", "sender.cpp"])
def test_what_the_sender_sends_leaves_by_the_interface(btp: Bench, programs: dict[str, list[str]], name: str) -> None:
    with running(programs[name], btp.station.address("from_users")):
        heard = btp.air.hear()
    assert heard.port == 2001
    assert heard.pdu == bytes.fromhex("020200000539") + bytes(35)


@pytest.mark.parametrize("name", ["receiver.py", "receiver.cpp"])
def test_the_receiver_prints_what_comes_by_the_interface(btp: Bench, programs: dict[str, list[str]], name: str) -> None:
    with running(programs[name], btp.station.address("to_users")) as child:
        assert child.stdout is not None
        for _ in range(int(PATIENCE * 1000 / JOIN_MS)):
            btp.air.send(sent := mark())
            if select.select([child.stdout], [], [], JOIN_MS / 1000)[0]:
                break
        said = child.stdout.readline().decode()
    assert "cam" in said
    assert f"{len(sent)} octets" in said


def test_the_program_with_messages_reads_changes_and_is_told_what_is_wrong(programs: dict[str, list[str]]) -> None:
    said = subprocess.run(programs["messages.py"], capture_output=True, text=True, check=True).stdout.splitlines()
    assert said[0] == "station 2602961571 at 50.0401189 14.4050093"
    assert said[1].startswith("020200001267")
    assert said[2].startswith("cam.generationDeltaTime: ")
    assert "70000" in said[2]
    assert "0..65535" in said[2]


@pytest.mark.parametrize("text", TOML, ids=range(len(TOML)))
def test_every_configuration_is_accepted(tmp_path: Path, text: str) -> None:
    file = tmp_path / "captain.toml"
    file.write_text(text)
    assert config.load(str(file), board="none").interfaces


def test_every_table_of_hardware_is_accepted(tmp_path: Path) -> None:
    assert HARDWARE
    for text in HARDWARE:
        (tmp_path / "mine.toml").write_text(text)
        assert config.load(None, board=str(tmp_path / "mine.toml")).board.has_hardware


def test_every_board_is_accepted_and_has_neighbours(tmp_path: Path) -> None:
    assert BOARDS
    for text in BOARDS:
        (tmp_path / "crowd.toml").write_text(text)
        read = config.load(None, board=str(tmp_path / "crowd.toml"))
        assert read.interfaces
        assert read.board.neighbours


@pytest.mark.parametrize("row", ROWS, ids=lambda row: str(row.number))
def test_the_traffic_class_of_every_type_is_told(row: TypeRow) -> None:
    (told,) = re.findall(
        rf"^\| (?:\d+ and )?{row.number}(?: and \d+)? \| `{row.name}` \|.* (\d+) \|$", README, re.MULTILINE
    )
    assert int(told) == row.traffic_class


def test_every_option_is_in_a_table_or_an_example() -> None:
    kinds = [
        tables.StationOptions,
        NeighboursOptions,
        tables.EndpointOptions,
        tables.ReceptionOptions,
        tables.TimeOptions,
        description.PulseDescription,
        tables.QueueOptions,
    ]
    kinds += [tables.TypeConfig, tables.Match, tables.PolicyRow, tables.PlaceMatch, tables.NeighbourMatch]
    kinds += [description.Hardware, description.SlotDescription, description.LineDescription]
    kinds += [driver.Options for driver in DRIVERS.values()]
    missing = {field.name for kind in kinds for field in fields(kind)} - set(re.findall(r"[a-z0-9_]+", README))
    assert missing == set()


def test_every_reason_is_explained() -> None:
    assert [reason for reason in Reason if f"`{reason}`" not in README] == []
