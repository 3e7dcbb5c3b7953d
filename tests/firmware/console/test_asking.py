"""A question to a station that is there, is not, is stuck, is another program, or is stopped in between."""

import os
import re
import socket
from pathlib import Path

import pytest

from board.runtime.errors import StationError
from firmware.console import asking
from firmware.console.asking import ANSWER_S, Asking, Status
from firmware.endpoint.control.control_socket import ControlSocket
from firmware.endpoint.control.question import Commands
from tests.said import tells
from tests.virtual import VirtualLoop


class Answers(list[Status | StationError]):
    """What Asking has told."""

    @property
    def why(self) -> str:
        (answer,) = self
        assert isinstance(answer, StationError)
        return answer.message


def ask(loop: VirtualLoop, *paths: Path) -> Answers:
    """One question, and its one answer."""
    answers = Answers()
    Asking(loop, [str(path) for path in paths], answers.append)
    assert not answers, "told from within"
    loop.run_until(lambda: bool(answers), within=ANSWER_S + 1)
    loop.run_for(ANSWER_S + 1)
    return answers


def listening(path: Path) -> socket.socket:
    listener = socket.socket(socket.AF_UNIX)
    listener.bind(str(path))
    listener.listen(1)
    return listener


def test_a_status_is_brought(loop: VirtualLoop, tmp_path: Path) -> None:
    path = tmp_path / "a.sock"
    station = ControlSocket(loop, str(path), Commands({"status": lambda _: {"status": {"station": "x" * 100_000}}}))
    assert ask(loop, tmp_path / "none.sock", path) == [{"station": "x" * 100_000}]
    station.close()


def test_a_socket_that_a_killed_station_left_is_passed_over(loop: VirtualLoop, tmp_path: Path) -> None:
    listening(tmp_path / "left.sock").close()
    path = tmp_path / "a.sock"
    station = ControlSocket(loop, str(path), Commands({"status": lambda _: {"status": {"pid": 1}}}))
    assert ask(loop, tmp_path / "left.sock", path) == [{"pid": 1}]
    station.close()
    assert ask(loop, tmp_path / "left.sock").why == (f"no station answers: {tmp_path}/left.sock: Connection refused")


def test_nobody_there_is_told_with_where_it_was_looked(loop: VirtualLoop, tmp_path: Path) -> None:
    why = ask(loop, tmp_path / "a.sock", tmp_path / "b.sock").why
    assert why == f"no station answers: no socket {tmp_path}/a.sock or {tmp_path}/b.sock"


def test_a_socket_that_may_not_be_opened_is_told(
    loop: VirtualLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Root may open all: what another user is told is what connect(2) says to it.
    class Forbidden(socket.socket):
        def connect(self, address: object) -> None:
            raise PermissionError(13, os.strerror(13))

    listener = listening(tmp_path / "a.sock")
    monkeypatch.setattr(asking.socket, "socket", Forbidden)
    assert ask(loop, tmp_path / "a.sock").why.endswith("a.sock: Permission denied")
    listener.close()


def test_a_station_that_is_stuck_is_given_up_in_time(loop: VirtualLoop, tmp_path: Path) -> None:
    listener = listening(tmp_path / "a.sock")
    began = loop.now
    answers = Answers()
    Asking(loop, [str(tmp_path / "a.sock")], answers.append)
    loop.run_until(lambda: bool(answers))
    assert answers.why.endswith("a.sock: no answer within 3 s")
    assert loop.now - began == pytest.approx(ANSWER_S)
    listener.close()


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (b"", "0 octets without end of line"),
        (b'{"status": {}', "13 octets without end of line"),
        (b"SSH-2.0-OpenSSH\r\n", "not a station: b'SSH-2.0-OpenSSH"),
        (b"[1, 2]\n", "not a station"),
        (b'{"ok": true, "status": 3}\n', "not a station"),
        (b"[" * 100_000 + b"\n", "not a station"),
        (b"\xff\xfe\n", "not a station"),
    ],
)
def test_what_is_no_station_is_told(loop: VirtualLoop, tmp_path: Path, said: bytes, words: str) -> None:
    listener = listening(tmp_path / "a.sock")
    answers = Answers()
    Asking(loop, [str(tmp_path / "a.sock")], answers.append)
    end, _ = listener.accept()
    assert end.recv(100) == b'{"do": "status"}\n'
    end.sendall(said)
    end.close()
    loop.run_until(lambda: bool(answers), within=1.0)
    assert words in answers.why
    listener.close()


def test_answer_without_end_is_refused_with_its_size(
    loop: VirtualLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(asking, "MAX_ANSWER", 1000)
    listener = listening(tmp_path / "a.sock")
    answers = Answers()
    Asking(loop, [str(tmp_path / "a.sock")], answers.append)
    end, _ = listener.accept()
    end.sendall(b"x" * 2000)
    loop.run_until(lambda: bool(answers), within=1.0)
    assert re.search(r"\d{4} octets .*end of line", answers.why)
    end.close()
    listener.close()


def test_who_has_left_is_told_nothing(loop: VirtualLoop, tmp_path: Path) -> None:
    answers = Answers()
    for paths in ([], [str(tmp_path / "a.sock")]):
        question = Asking(loop, paths, answers.append)
        question.leave()
        question.leave()
    loop.run_for(10.0)
    assert answers == []


def test_socket_of_another_user_in_a_folder_of_all_users_is_refused(
    loop: VirtualLoop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tmp_path.chmod(0o777)
    station = ControlSocket(loop, str(tmp_path / "a.sock"), Commands({"status": lambda _: {"status": {"pid": 1}}}))
    assert ask(loop, tmp_path / "a.sock") == [{"pid": 1}]
    monkeypatch.setattr(asking, "PEER", Stranger())
    assert tells(ask(loop, tmp_path / "a.sock").why, "socket", f"user {STRANGER}", "may not")
    station.close()


STRANGER = os.getuid() + 1000


class Stranger:
    """struct ucred of another user."""

    size = asking.PEER.size

    def unpack(self, octets: bytes) -> tuple[int, int, int]:
        return (4711, STRANGER, STRANGER)
