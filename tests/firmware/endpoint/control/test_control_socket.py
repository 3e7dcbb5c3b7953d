"""The Unix socket of the command line: one JSON object a line, one line back, whatever is written to it."""

import json
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from board.runtime.errors import InterfaceError, StationError
from drivers.contract import Answer
from firmware.endpoint.control.control_socket import MAX_CLIENTS, MAX_LINE, ControlSocket, default_path
from firmware.endpoint.control.question import Commands
from tests.said import tells
from tests.virtual import VirtualLoop


def refuse(_: dict[str, object]) -> dict[str, object]:
    raise StationError("cannot", "do something else")


NOW = {
    "status": lambda command: {"status": {"asked": command.get("number")}},
    "long": lambda command: {"text": "x" * 1_000_000},
    "refuse": refuse,
}
COMMANDS = Commands(NOW)
SLOW_S = 100.0


class Bench:
    """asked: the answers that commands which answer later wait for."""

    def __init__(self, loop: VirtualLoop, path: str) -> None:
        self.loop = loop
        self.asked: list[Answer] = []
        later = dict.fromkeys(("later", "slow"), lambda question, answer: self.asked.append(answer))
        later["at_once"] = self.at_once
        self.server = ControlSocket(loop, path, Commands(NOW, later, {"slow": SLOW_S}))
        self.clients: list[socket.socket] = []

    def at_once(self, question: dict[str, object], answer: Answer) -> None:
        answer({"number": question.get("number")})
        answer({"number": "a second time"})

    def client(self) -> socket.socket:
        client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        client.connect(self.server.path)
        client.setblocking(False)
        self.clients.append(client)
        self.turn()
        return client

    def turn(self) -> None:
        for _ in range(4):
            self.loop.run_for(0)  # what is ready, without moving the clock

    def tell(self, client: socket.socket, octets: bytes) -> None:
        client.send(octets)
        self.turn()

    def lines(self, client: socket.socket) -> list[dict[str, object]]:
        """All that was answered so far."""
        octets = b""
        while True:
            self.turn()
            try:
                part = client.recv(1 << 20)
            except BlockingIOError:
                break
            if not part:
                break
            octets += part
        assert not octets or octets.endswith(b"\n")
        return [json.loads(line) for line in octets.splitlines()]

    def is_closed(self, client: socket.socket) -> bool:
        self.turn()
        try:
            return client.recv(1) == b""
        except BlockingIOError:
            return False
        except ConnectionResetError:
            return True

    def close(self) -> None:
        for client in self.clients:
            client.close()
        self.server.close()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with closing(VirtualLoop()) as loop, closing(Bench(loop, f"{tmp_path}/captain.sock")) as bench:
        yield bench


STATUS = b'{"do": "status"}\n'
ANSWER = {"ok": True, "status": {"asked": None}}


def test_a_line_is_answered_by_a_line(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "status", "number": 5}\n')
    assert bench.lines(client) == [{"ok": True, "status": {"asked": 5}}]


def test_several_lines_are_answered_in_their_order_on_one_connection(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "status", "number": 1}\n{"do": "status", "number": 2}\n{"do": "st')
    bench.tell(client, b'atus", "number": 3}\n')
    assert [answer["status"]["asked"] for answer in bench.lines(client)] == [1, 2, 3]


def test_a_line_may_come_octet_by_octet(bench: Bench) -> None:
    client = bench.client()
    for octet in STATUS:
        bench.tell(client, bytes((octet,)))
    assert bench.lines(client) == [ANSWER]


def test_what_a_command_refuses_is_told_with_what_to_do(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "refuse"}\n')
    assert bench.lines(client) == [{"ok": False, "error": "cannot", "hint": "do something else"}]


@pytest.mark.parametrize("line", [b"", b"status", b"{", b"\xff\xfe", b"[" * 4000, b"\x00", b'{"do": status}', b"{} {}"])
def test_what_is_not_json_is_refused_and_the_next_line_is_answered(bench: Bench, line: bytes) -> None:
    client = bench.client()
    bench.tell(client, line + b"\n")
    bench.tell(client, STATUS)
    wrong, right = bench.lines(client)
    assert (wrong["ok"], wrong["error"]) == (False, "not JSON")
    assert right == ANSWER


@pytest.mark.parametrize(
    "line",
    [
        b"{}",
        b"[]",
        b"5",
        b"null",
        b'"status"',
        b'{"do": 5}',
        b'{"do": ["status"]}',
        b'{"do": "statu"}',
        b'{"do": "\\ud800"}',
    ],
)
def test_what_is_no_command_is_refused_with_those_that_there_are(bench: Bench, line: bytes) -> None:
    client = bench.client()
    bench.tell(client, line + b"\n")
    (answer,) = bench.lines(client)
    assert answer["ok"] is False
    assert answer["hint"] == "one of at_once, later, long, refuse, slow, status"


def test_line_without_an_end_is_refused_and_takes_no_room(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b"x" * MAX_LINE)
    assert bench.lines(client) == []
    for _ in range(50):
        bench.tell(client, b"x" * MAX_LINE)
    (error,) = {answer["error"] for answer in bench.lines(client)}
    assert tells(error, "line", f" {MAX_LINE} octets")
    (held,) = bench.server.clients
    assert len(held._unread) <= MAX_LINE
    bench.tell(client, b"\n" + STATUS)
    assert bench.lines(client)[-1] == ANSWER


def test_many_short_lines_at_once_are_no_long_line(bench: Bench) -> None:
    client = bench.client()
    count = 3 * MAX_LINE // len(STATUS)
    bench.tell(client, STATUS[:10])
    bench.tell(client, STATUS[10:] + STATUS * (count - 1))
    assert bench.lines(client) == [ANSWER] * count


def test_a_client_that_never_reads_holds_nobody_up(bench: Bench) -> None:
    silent = bench.client()
    bench.tell(silent, b'{"do": "long"}\n' * 5)
    other = bench.client()
    bench.tell(other, STATUS)
    assert bench.lines(other) == [ANSWER]
    assert [len(answer["text"]) for answer in bench.lines(silent)] == [1_000_000] * 5


def test_a_client_that_leaves_before_its_answer_is_forgotten(bench: Bench) -> None:
    client = bench.client()
    client.send(b'{"do": "long"}\n')
    client.close()
    bench.turn()
    bench.turn()
    assert not bench.server.clients


def test_a_client_that_leaves_in_the_middle_of_its_answer_is_forgotten(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "long"}\n')
    client.close()
    bench.turn()
    assert not bench.server.clients


def test_a_client_that_has_said_all_is_still_answered(bench: Bench) -> None:
    client = bench.client()
    client.send(STATUS)
    client.shutdown(socket.SHUT_WR)
    bench.turn()
    assert bench.lines(client) == [ANSWER]


def test_one_client_too_many_takes_the_place_of_the_one_that_was_silent_for_the_longest(bench: Bench) -> None:
    clients = [bench.client() for _ in range(MAX_CLIENTS)]
    bench.tell(clients[0], STATUS)
    assert bench.lines(clients[0]) == [ANSWER]
    late = bench.client()
    bench.turn()
    assert bench.is_closed(clients[1])
    for client in (clients[0], late):
        bench.tell(client, STATUS)
        assert bench.lines(client) == [ANSWER]


def test_a_hundred_clients_one_after_the_other_leave_nothing_behind(bench: Bench) -> None:
    for _ in range(100):
        client = bench.client()
        bench.tell(client, STATUS)
        assert bench.lines(client) == [ANSWER]
        client.close()
        bench.turn()
    assert not bench.server.clients


def test_an_answer_may_come_later(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "later"}\n')
    bench.loop.run_for(5)
    assert bench.lines(client) == []
    bench.asked[0]({"registered": True})
    assert bench.lines(client) == [{"ok": True, "registered": True}]


def test_an_answer_of_those_that_may_be_late_may_come_at_once_and_is_the_only_one(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "at_once", "number": 1}\n' * 3)
    assert bench.lines(client) == [{"ok": True, "number": 1}] * 3


def test_a_late_error_is_told_with_what_to_do(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "later"}\n')
    bench.asked[0](StationError("cannot", "do something else"))
    assert bench.lines(client) == [{"ok": False, "error": "cannot", "hint": "do something else"}]


def test_answer_that_does_not_come_in_time_is_an_error_and_comes_no_more(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "later", "within_s": 3}\n')
    bench.loop.run_for(3)
    bench.asked[0]({"registered": True})
    (answer,) = bench.lines(client)
    assert answer.keys() == {"ok", "error", "hint"}
    assert answer["ok"] is False
    assert tells(answer["error"], "later: ", "no answer", "3 s")
    assert "status" in answer["hint"]


def test_an_answer_of_a_slow_command_is_waited_for_longer_unless_the_question_says(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "slow"}\n')
    bench.loop.run_for(SLOW_S - 1.0)
    assert bench.lines(client) == []
    bench.asked[0]({"rows": 1})
    assert bench.lines(client) == [{"ok": True, "rows": 1}]
    bench.tell(client, b'{"do": "slow", "within_s": 3}\n')
    bench.loop.run_for(3)
    assert bench.lines(client)[0]["error"] == "slow: no answer within 3 s"


@pytest.mark.parametrize("within", ["0", "-1", "601", "1e999", "true", '"3"', "null", "[]"])
def test_a_time_that_is_none_is_refused(bench: Bench, within: str) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "later", "within_s": %s}\n' % within.encode())
    (answer,) = bench.lines(client)
    assert answer["ok"] is False
    assert not bench.asked


def test_answers_keep_the_order_of_their_lines_and_others_are_not_held_up(bench: Bench) -> None:
    client, other = bench.client(), bench.client()
    bench.tell(client, STATUS + b'{"do": "later"}\n' + b"x" * 5 + b"\n" + STATUS)
    bench.tell(client, STATUS)
    bench.tell(other, STATUS)
    assert bench.lines(other) == [ANSWER]
    assert bench.lines(client) == [ANSWER]
    bench.asked[0]({})
    answers = bench.lines(client)
    assert [answer.get("error") for answer in answers] == [None, "not JSON", None, None]


def test_a_client_that_leaves_while_its_answer_is_waited_for_is_forgotten(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "later"}\n')
    client.close()
    bench.turn()
    assert not bench.server.clients
    bench.asked[0]({})
    bench.loop.run_for(20)


def test_a_client_that_has_said_all_is_still_answered_later(bench: Bench) -> None:
    client = bench.client()
    bench.tell(client, b'{"do": "later"}\n')
    client.shutdown(socket.SHUT_WR)
    bench.turn()
    bench.asked[0]({})
    assert bench.lines(client) == [{"ok": True}]
    bench.turn()
    assert not bench.server.clients


@given(st.lists(st.binary(max_size=300), max_size=6))
def test_any_octets_are_answered_or_end_the_connection(
    tmp_path_factory: pytest.TempPathFactory, parts: list[bytes]
) -> None:
    assume(b'"do"' not in b"".join(parts))  # hypothesis also tries constants of the code, which are valid questions
    path = tmp_path_factory.mktemp("control") / "s"
    with closing(VirtualLoop()) as loop, closing(Bench(loop, str(path))) as bench:
        client = bench.client()
        for part in parts:
            bench.tell(client, part) if part else None
        answers = bench.lines(client)
        assert len(answers) == b"".join(parts).count(b"\n")
        assert all(answer["ok"] is False for answer in answers)


def test_the_socket_file_is_for_owner_and_group_and_goes_with_the_station(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "down" / "captain.sock"
    with closing(VirtualLoop()) as loop:
        server = ControlSocket(loop, str(path), COMMANDS)
        assert stat.S_IMODE(os.stat(path).st_mode) == 0o660
        server.close()
        assert not path.exists()


def test_a_socket_file_that_a_killed_station_left_is_taken_over(tmp_path: Path) -> None:
    path = str(tmp_path / "captain.sock")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
        dead.bind(path)
    with closing(VirtualLoop()) as loop, closing(Bench(loop, path)) as bench:
        client = bench.client()
        bench.tell(client, STATUS)
        assert bench.lines(client) == [ANSWER]


def test_path_that_another_station_has_is_left_to_it(bench: Bench) -> None:
    with closing(VirtualLoop()) as loop:
        with pytest.raises(InterfaceError) as caught:
            ControlSocket(loop, bench.server.path, COMMANDS)
        assert bench.server.path in str(caught.value)
        assert "another station" in caught.value.hint
    client = bench.client()
    bench.tell(client, STATUS)
    assert bench.lines(client) == [ANSWER]


def test_a_station_that_is_stuck_does_not_hold_up_the_next(tmp_path: Path) -> None:
    path = str(tmp_path / "captain.sock")
    with closing(VirtualLoop()) as loop, socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as stuck:
        stuck.bind(path)
        stuck.listen(0)
        waiting = [socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK) for _ in range(4)]
        for client in waiting:
            client.connect_ex(path)
        with pytest.raises(InterfaceError, match="cannot listen"):
            ControlSocket(loop, path, COMMANDS)
        for client in waiting:
            client.close()


def test_a_path_that_cannot_be_is_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with closing(VirtualLoop()) as loop:
        for path in (tmp_path / "file", tmp_path / "file" / "below", tmp_path):
            with pytest.raises(InterfaceError, match=r"endpoint\.control: cannot listen on"):
                ControlSocket(loop, str(path), COMMANDS)
    assert (tmp_path / "file").exists()


def test_the_default_path_is_in_the_runtime_folder_and_named_by_the_first_port(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert default_path(5555) == f"{tmp_path}/captain-5555.sock"
    assert default_path(6000) != default_path(5555)


def test_a_runtime_folder_that_is_not_there_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "nowhere"))
    assert not default_path(5555).startswith(str(tmp_path))
