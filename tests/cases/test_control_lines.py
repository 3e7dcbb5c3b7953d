"""Control socket: clients that send many lines at once have one turn each, as all others."""

import json
import socket
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from board.runtime.loop import Loop
from firmware.endpoint.control.control_socket import MAX_LINE, ControlSocket
from firmware.endpoint.control.question import Commands, Question

LINE = b'{"do":"count"}\n'
CLIENTS = 4


class Bench:
    """A control socket that counts what it was asked."""

    def __init__(self, path: str) -> None:
        self.asked = 0
        self.loop = Loop()
        self.server = ControlSocket(self.loop, path, Commands({"count": self.count}))

    def count(self, question: Question) -> dict[str, object]:
        self.asked += 1
        return {"number": self.asked}

    def client(self) -> socket.socket:
        client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        client.connect(self.server.path)
        client.setblocking(False)
        self.turn()
        return client

    def turn(self) -> int:
        """One turn of the loop, which is never waited for; returns how much was asked in it."""
        before = self.asked
        self.loop.after(0.0, lambda: None)
        self.loop.turn()
        return self.asked - before

    def close(self) -> None:
        self.server.close()
        self.loop.close()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with closing(Bench(f"{tmp_path}/control")) as bench:
        yield bench


def test_of_many_lines_at_once_a_turn_of_the_loop_takes_one_of_each_client(bench: Bench) -> None:
    count = MAX_LINE // len(LINE)
    with ExitStack() as ending:
        clients = [ending.enter_context(bench.client()) for _ in range(CLIENTS)]
        for client in clients:
            client.send(LINE * count)
        turns = [bench.turn() for _ in range(count + 10)]
        assert max(turns) == CLIENTS
        assert bench.asked == CLIENTS * count
        for client in clients:
            answers = [json.loads(line) for line in client.recv(1 << 20).splitlines()]
            assert len(answers) == count
            assert [one["number"] for one in answers] == sorted(one["number"] for one in answers)


def test_a_client_beside_those_that_send_many_lines_is_answered_in_two_turns(bench: Bench) -> None:
    with ExitStack() as ending:
        for _ in range(CLIENTS):
            ending.enter_context(bench.client()).send(LINE * 256)
        bench.turn()
        honest = ending.enter_context(bench.client())
        honest.send(LINE)
        bench.turn()
        bench.turn()
        assert json.loads(honest.recv(100))["ok"]


def test_a_client_that_hangs_up_with_lines_unanswered_leaves_nothing_behind(bench: Bench) -> None:
    with bench.client() as client:
        client.send(LINE * 200)
        bench.turn()
    for _ in range(10):
        bench.turn()
    assert bench.asked < 200
    assert not bench.server.clients
    assert set(bench.loop._sources) == {bench.server.fileno()}
