"""README and guides: their programs run against a station, their configurations load, their tables are complete."""

import re
import select
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from firmware.config import captain_toml, tables
from tests import documents
from tests.system.conftest import Bench
from tests.system.station import PATIENCE, ROOT
from tests.system.user import JOIN_MS, mark

PAGES = {path: path.read_text() for path in [ROOT / "README.md", *sorted(ROOT.glob("*/guide/*.md"))]}
TEXT = "\n".join([*PAGES.values(), *(path.read_text() for path in sorted(ROOT.glob("firmware/reference/*.md")))])
# Programs of the pages by name, which is in the comment of their first line.
PROGRAMS = {
    name: code
    for code, name in re.findall(r"^```(?:python|cpp)\n((?:#|//) (\w+\.\w+).*?)^```", TEXT, re.MULTILINE | re.DOTALL)
}


def blocks(tag: str) -> list[object]:
    """Return the fenced blocks of all pages with this tag, each with the name of its page."""
    return [
        pytest.param(code, id=f"{page.stem}{index}")
        for page, text in PAGES.items()
        for index, code in enumerate(documents.blocks(text, tag))
    ]


CAM = bytes.fromhex("02029b260aa393e6005a6f0da4ae7bfb35a238230a6a3d4290581a90a3f67e02e6928b37fee9fea6103fdf93d980")
# Declarations of the interfaces that the guide's policy rows name.
INTERFACES = "".join(f"\n[interfaces.{name}]\ndriver = 'udp'\nlisten = '127.0.0.1:0'\n" for name in ("g5", "backhaul"))
LONGEST = 20  # limit of non-empty lines


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Return the command of each program by name; C++ programs are compiled."""
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


def test_pages_have_the_programs_and_board_files_that_follow() -> None:
    assert blocks("toml hardware")
    assert blocks("toml board")
    assert {"sender.py", "sender.cpp", "receiver.py", "receiver.cpp", "send_one.py", "messages.py"} <= set(PROGRAMS)


@pytest.mark.parametrize("name", PROGRAMS)
def test_program_of_a_page_has_at_most_20_lines(name: str) -> None:
    lines = [line for line in PROGRAMS[name].splitlines() if line.strip() and not line.startswith(("//", "# "))]
    assert len(lines) <= LONGEST


@pytest.mark.parametrize("name", ["sender.py", "sender.cpp"])
def test_what_the_sender_sends_leaves_by_the_interface(btp: Bench, programs: dict[str, list[str]], name: str) -> None:
    with running(programs[name], btp.station.address("from_users")):
        heard = btp.air.hear()
    assert heard.port == 2001
    assert heard.pdu == CAM


def test_send_one_prints_the_confirms_of_the_station_and_of_the_interface(
    btp: Bench, programs: dict[str, list[str]]
) -> None:
    addresses = [btp.station.address("pull"), btp.station.address("report")]
    done = subprocess.run(
        [*programs["send_one.py"], *addresses], capture_output=True, text=True, check=True, timeout=PATIENCE
    )
    assert [line.split() for line in done.stdout.splitlines()] == [["accepted"], ["sent", "g5"]]
    assert btp.air.hear().pdu == CAM


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


@pytest.mark.parametrize("text", blocks("toml"))
def test_configuration_of_a_page_is_accepted(tmp_path: Path, text: str) -> None:
    file = tmp_path / "captain.toml"
    file.write_text(text)
    assert captain_toml.load(str(file), board="none").tables != tables.Tables()


@pytest.mark.parametrize("text", blocks("toml policy"))
def test_policy_row_of_a_page_is_accepted(tmp_path: Path, text: str) -> None:
    file = tmp_path / "captain.toml"
    file.write_text(text + INTERFACES)
    assert captain_toml.load(str(file), board="none").tables.policy


@pytest.mark.parametrize("text", blocks("toml hardware"))
def test_hardware_of_a_page_is_accepted(tmp_path: Path, text: str) -> None:
    (tmp_path / "mine.toml").write_text(text)
    assert captain_toml.load(None, board=str(tmp_path / "mine.toml")).board.has_hardware


@pytest.mark.parametrize("text", blocks("toml board"))
def test_board_of_a_page_is_accepted_and_has_neighbours(tmp_path: Path, text: str) -> None:
    (tmp_path / "crowd.toml").write_text(text)
    read = captain_toml.load(None, board=str(tmp_path / "crowd.toml"))
    assert read.interfaces
    assert read.board.neighbours
