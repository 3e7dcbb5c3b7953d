import io
import os
import re
import signal
import socket
import tomllib

import pytest

from board import describe
from board.address import Address
from firmware import cli
from firmware.board_file import Board
from firmware.commands import demo
from tests.firmware.commands.test_program import is_gone


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
    assert f"to A: PUB to tcp://127.0.0.1:{block}, SUB to tcp://127.0.0.1:{block + 1}" in said
    assert f"to B: PUB to tcp://127.0.0.1:{block + 10}, SUB to tcp://127.0.0.1:{block + 11}" in said
    assert "received by A's user" in said
    assert re.search(r"B's user +cam +4202 +\d+", said)
    assert "A received " in said.splitlines()[-2]
    assert "\x1b" not in said


def test_without_a_terminal_it_ends_by_itself(monkeypatch):
    monkeypatch.setattr(demo, "WITHOUT_TERMINAL_S", 0.3)
    assert cli.main(["demo"]) == 0


def test_ports_that_are_taken_are_told_and_left(block, capsys):
    with socket.create_server(("127.0.0.1", block + 1)):
        assert cli.main(["demo", "--duration", "0.3"]) == 0
    said = capsys.readouterr().out
    assert f"Ports {block} to {block + 3} are not free (another program): A takes " in said
    assert f"PUB to tcp://127.0.0.1:{block}," not in said


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


def test_messages_of_the_users_have_a_station_id_of_their_own():
    pdu = demo.pdu_of("cam", 4201)
    assert (pdu[1], int.from_bytes(pdu[2:6])) == (2, 4201)
    assert len(pdu) == 41
