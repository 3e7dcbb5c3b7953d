import io
import math
import os
import re
import signal
import socket
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from board.runtime import describe
from board.runtime.address import Address
from drivers.sim import messages
from drivers.sim.track import Motion
from firmware import cli
from firmware.client import client
from firmware.client.received import Message, Pairing
from firmware.client.show.tally import Tally
from firmware.commands import demo
from firmware.config.board_file import Board
from firmware.lab.demo_user import MAC, PATH
from tests.firmware.lab.test_program import is_gone


@pytest.fixture(autouse=True)
def started(block, monkeypatch):
    """The children of a demo on free ports; none may be left."""
    children = []

    class Recorded(demo.Program):
        def __init__(self, *arguments: object) -> None:
            super().__init__(*arguments)
            children.append(self)

    monkeypatch.setattr(demo, "Program", Recorded)
    monkeypatch.setattr(demo, "FIRST_PORT", block)
    monkeypatch.setattr("sys.stdin", io.StringIO())
    yield children
    assert all(is_gone(child.pid) for child in children)


def test_both_users_receive_what_the_other_sends(block, monkeypatch, capsys):
    monkeypatch.setattr(demo, "PRINT_S", 0.3)
    assert cli.main(["demo", "--duration", "0.5"]) == 0
    said = capsys.readouterr().out
    assert f"at A        tcp://127.0.0.1:{block}  tcp://127.0.0.1:{block + 1}\n" in said
    assert f"at B        tcp://127.0.0.1:{block + 10}  tcp://127.0.0.1:{block + 11}\n" in said
    assert "received by A's user" in said
    assert re.search(r"B's user +cam +4202 +\d+ .* 20.0 m/s \d+ deg", said)
    assert "A received " in said.splitlines()[-2]
    assert "\x1b" not in said


@pytest.mark.parametrize(
    ("started", "path", "printed"),
    [
        (".venv/bin/captain", "/nowhere", ".venv/bin/captain"),
        (".venv/bin/captain", ".venv/bin", "captain"),
        (".venv/bin/captain", "other/bin", ".venv/bin/captain"),
        ("firmware/__main__.py", "/nowhere", "captain"),
    ],
)
def test_introduction_names_the_program_as_another_terminal_starts_it(tmp_path, monkeypatch, started, path, printed):
    for folder in (".venv/bin", "other/bin"):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / "captain").touch(mode=0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(Path(tmp_path, path)))
    monkeypatch.setattr("sys.argv", [started, "demo"])
    station = demo.DemoStation("B", client.Address("127.0.0.1", 5565, 5566, 5567, 5568), None)
    assert f" terminal: {printed} listen --station :5565\n" in demo.introduction([station])


def test_without_a_terminal_it_ends_by_itself(monkeypatch):
    monkeypatch.setattr(demo, "WITHOUT_TERMINAL_S", 0.3)
    assert cli.main(["demo"]) == 0


def test_ports_that_are_taken_are_told_and_left(block, capsys):
    with socket.create_server(("127.0.0.1", block + 1)):
        assert cli.main(["demo", "--duration", "0.3"]) == 0
    said = capsys.readouterr().out
    assert f"Ports {block} to {block + 3} are in use (another program). A takes " in said
    assert f"tcp://127.0.0.1:{block} " not in said


def test_users_that_hear_nothing_of_each_other_end_it_with_1(monkeypatch, capsys):
    monkeypatch.setattr(demo.User, "send", lambda self: None)
    monkeypatch.setattr(demo, "LATE_S", 0.1)
    assert cli.main(["demo", "--duration", "0.2"]) == 1
    assert "A received 0 CAM and 0 DENM from B's user." in capsys.readouterr().out


def test_a_station_that_dies_ends_it_with_its_name(started, monkeypatch, capsys):
    monkeypatch.setattr(demo.User, "send", lambda self: os.kill(started[1].pid, signal.SIGKILL))
    assert cli.main(["demo", "--duration", "2"]) == 1
    assert "station B ended with -9" in capsys.readouterr().err


def test_ctrl_c_ends_it_with_a_summary(monkeypatch, capsys):
    def pressed(self: demo.User) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(demo.User, "send", pressed)
    assert cli.main(["demo"]) == 1  # nothing was received so soon
    captured = capsys.readouterr()
    assert captured.out.endswith("B received 0 CAM and 0 DENM from A's user.\n")
    assert captured.err == ""


def test_a_station_that_cannot_start_ends_it_with_its_words(started, monkeypatch, capsys):
    monkeypatch.setattr(demo, "BOARD", demo.BOARD.replace("ethernet", "smoke"))
    assert cli.main(["demo", "--duration", "1"]) == 1
    said = capsys.readouterr().err
    assert "captain: station A ended with 1" in said
    assert "smoke" in said


def test_each_station_is_the_others_peer():
    boards = dict(demo.boards([Address("127.0.0.1", port) for port in (1001, 1002, 1003)]))
    read = {name: describe.read(Board, tomllib.loads(text), name) for name, text in boards.items()}
    a, b = read["A"].interfaces["g5"], read["B"].interfaces["g5"]
    assert b["peers"] == [a["listen"]]
    assert b["listen"] in a["peers"]
    assert read["A"].neighbours.to == a["listen"]
    assert read["A"].neighbours.listen in a["peers"]
    assert read["B"].neighbours is None


def test_a_message_of_an_own_program_at_a_is_decoded_in_the_table_of_bs_user(block, monkeypatch, capsys):
    own = messages.cam(1234, 0, Motion(470_500_000, 154_600_000, 420_000, 13_890, 9_000_000))
    send = demo.User.send

    def beside(self: demo.User) -> None:
        send(self)
        if self.name == "A":
            self._publish("cam", own)

    monkeypatch.setattr(demo.User, "send", beside)
    assert cli.main(["demo", "--duration", "0.5"]) == 0
    of_b = capsys.readouterr().out.rpartition("received by B's user")[2]
    assert re.search(r"A's user +cam +1234 .* 47\.05000 15\.46000 13\.9 m/s 90 deg", of_b)


def row(mac: str, station: int, kind: str = "cam") -> demo.TallyRow:
    made = demo.TallyRow(kind, station)
    made.source = mac
    return made


@pytest.mark.parametrize(
    ("mac", "sender"),
    [(MAC["A"], "A's user"), (MAC["B"], "B's user"), ("02:aa:00:00:12:67", "neighbour"), ("", "")],
)
def test_the_sender_of_a_row_follows_from_its_source_address(mac, sender):
    assert demo._sender(row(mac, 4201)) == sender


def test_the_tables_of_both_users_fit_a_screen_and_rows_of_users_stay():
    tallies = {
        "A": [row("02:aa:00:00:12:67", 4711 + number) for number in range(40)] + [row(MAC["B"], 4202)],
        "B": [row(MAC["A"], number) for number in (1234, 4201)],
    }
    users: list[Any] = [
        SimpleNamespace(name=name, tally=SimpleNamespace(rows=lambda rows=rows: rows, total=0), pairing=Pairing())
        for name, rows in tallies.items()
    ]
    of_a, of_b = demo.view(users, 0.0, 17, None)
    assert len(of_a.rows) + len(of_b.rows) == 17 - 2 * demo.HEADING - 1
    assert [cells[:3] for cells in of_b.rows] == [("A's user", "cam", "1234"), ("A's user", "cam", "4201")]
    assert of_a.rows[0][:3] == ("B's user", "cam", "4202")
    assert of_a.rows[-1][2] == "others"


def test_row_of_the_demo_after_ten_silent_seconds_is_hidden():
    tally = Tally()
    tally.add(Message("cam", messages.cam(1234, 0, Motion(0, 0, 0, 0, 0)), None), 1.0)
    tally.add(Message("cam", messages.cam(4202, 0, Motion(0, 0, 0, 0, 0)), None), 11.5)
    user: Any = SimpleNamespace(name="A", tally=tally, pairing=Pairing())
    seen = [[cells[2] for cells in demo.view([user], now, 17, None)[0].rows] for now in (10.9, 12.0)]
    assert seen == [["1234", "4202"], ["4202"]]
    assert demo.view([user], 12.0, 17, None)[0].title == "received by A's user: 2 messages"


@pytest.mark.parametrize("name", ["A", "B"])
def test_a_vehicle_of_the_demo_drives_as_fast_and_as_far_as_its_motion_says(name):
    motions = [PATH[name].at(722_000_000.0 + second) for second in range(300)]
    for before, one, after in zip(motions, motions[1:], motions[2:], strict=False):
        north = (after.latitude - before.latitude) * 0.01113
        east = (after.longitude - before.longitude) * 0.01113 * math.cos(math.radians(48.766))
        assert math.hypot(north, east) == pytest.approx(2 * one.speed_mm_s / 1000, rel=0.01)
        error = math.degrees(math.atan2(east, north)) - one.heading / 1e5
        assert (error + 180) % 360 - 180 == pytest.approx(0, abs=0.5)
