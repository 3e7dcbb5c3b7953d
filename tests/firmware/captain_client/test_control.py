"""Commands to a control socket, answered by a socket of the test."""

import json
import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from captain_client import control
from captain_client.address import parse
from captain_client.errors import RefusedError, StationError


@contextmanager
def answering(path: Path, answer: bytes) -> Iterator[list[bytes]]:
    """Listen at a path, answer one line, and yield the list of the lines that were asked."""
    asked: list[bytes] = []
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path))
        listener.listen()

        def serve() -> None:
            end, _ = listener.accept()
            with end:
                asked.append(end.recv(4096))
                end.sendall(answer)

        thread = threading.Thread(target=serve)
        thread.start()
        yield asked
        thread.join()


def test_command_is_one_line_and_its_answer_is_returned(tmp_path: Path):
    with answering(path := tmp_path / "s", b'{"ok": true, "rows": 2}\n') as asked:
        assert control.ask(str(path), "record", 5.0, text="near miss") == {"ok": True, "rows": 2}
    assert json.loads(asked[0]) == {"do": "record", "within_s": 5.0, "text": "near miss"}


@pytest.mark.parametrize(
    ("answer", "error", "said"),
    [
        (b'{"ok": false, "error": "no recorder", "hint": "name a folder"}\n', RefusedError, "no recorder"),
        (b"hello\n", StationError, "not a station"),
        (b"[]\n", StationError, "not a station"),
        (b"", StationError, "not a station"),
    ],
)
def test_command_that_is_refused_or_answered_by_another_program_raises(
    tmp_path: Path, answer: bytes, error: type[StationError], said: str
):
    with answering(path := tmp_path / "s", answer), pytest.raises(error, match=said):
        control.ask(str(path), "status")


def test_command_without_a_station_raises_with_the_path(tmp_path: Path):
    with pytest.raises(StationError, match="gone: no station answers: No such file"):
        control.ask(str(tmp_path / "gone"), "status")


def test_command_that_is_not_answered_in_time_raises(tmp_path: Path):
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(str(path := tmp_path / "s"))
        listener.listen()
        with pytest.raises(TimeoutError):
            control.exchange(str(path), b"{}\n", 0.01)


def test_answer_without_an_end_of_line_is_read_up_to_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(control, "MOST_OCTETS", 10)
    with answering(path := tmp_path / "s", bytes(11)):
        assert control.exchange(str(path), b"{}\n", 5.0) == bytes(11)


def test_path_that_the_user_gives_is_used_for_any_host():
    assert control.path_of(parse("captain-7.local"), "/run/own.sock") == "/run/own.sock"


def test_path_of_another_machine_raises():
    with pytest.raises(StationError, match=r"captain-7\.local is another machine"):
        control.path_of(parse("captain-7.local"), "")


def test_path_of_a_local_station_is_the_first_default_path_that_exists(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with pytest.raises(StationError, match="no station of this machine has port 64321"):
        control.path_of(parse(":64321"), "")
    (path := tmp_path / "captain-64321.sock").touch()
    assert control.path_of(parse(":64321"), "") == str(path)


def test_default_paths_are_those_of_the_station(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    from firmware.endpoint.control import control_socket

    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert control.default_paths(5565) == control_socket.default_paths(5565)


class Listener:
    """Connected socket whose other end belongs to a user."""

    def __init__(self, user: int) -> None:
        self._user = user

    def getsockopt(self, *_: int) -> bytes:
        return control.PEER.pack(1, self._user, self._user)


@pytest.mark.parametrize(("mode", "user"), [(0o755, 54321), (0o777, 0), (0o777, os.getuid())])
def test_socket_that_only_the_station_can_have_made_is_accepted(tmp_path: Path, mode: int, user: int):
    tmp_path.chmod(mode)
    control.check_peer(str(tmp_path / "s"), Listener(user))


def test_socket_of_another_user_in_a_folder_of_all_users_is_refused(tmp_path: Path):
    tmp_path.chmod(0o777)
    with pytest.raises(StationError, match="belongs to user 54321"):
        control.check_peer(str(tmp_path / "s"), Listener(54321))


def test_socket_of_this_process_belongs_to_its_user(tmp_path: Path):
    tmp_path.chmod(0o777)
    near, far = socket.socketpair(socket.AF_UNIX)
    with near, far:
        control.check_peer(str(tmp_path / "s"), near)
        assert (
            control.PEER.unpack(near.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, control.PEER.size))[1]
            == os.getuid()
        )
