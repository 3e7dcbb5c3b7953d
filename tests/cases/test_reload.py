"""SIGHUP with a captain.toml that is truncated, not a file, or has 10,000 rows."""

import logging
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import pytest

from board.runtime.child import BATCH, Child
from board.runtime.errors import ConfigurationError, RequestError, StationError
from board.runtime.loop import Loop
from firmware.config import reload, reload_child
from firmware.config.captain_toml import ConfigSource
from firmware.config.reload import difference
from firmware.routing.policy import Policy
from firmware.station.station import Station

CAM = bytes.fromhex("0202000005390000000000000000")
NEVER = '[[policy]]\nname = "never by air"\ninterfaces = []\n'


class Bench:
    """A station with one interface, whose policy withholds everything."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "captain.toml"
        self.defaults = folder / "defaults.toml"
        self.head = (
            f"[endpoint]\ncontrol = '{folder}/control'\nfrom_users = 0\nto_users = 0\npull = 0\nreport = 0\n"
            "[interfaces.air]\ndriver = 'udp'\nframing = 'pdu'\nlisten = '127.0.0.1:0'\n"
        )
        self.file.write_text(self.head + NEVER)
        self.defaults.write_text("[station]\nname = 'box'\n")
        self.loop = Loop()
        source = ConfigSource(str(self.file), (), "none", str(self.defaults))
        self.station = Station(self.loop, source.load(), source)

    def close(self) -> None:
        self.station.close()
        self.loop.close()

    def names(self) -> list[str]:
        return [row.name for row in self.station.router.policy.rows]

    def reload(self, turned: Callable[[], object] = lambda: None) -> object:
        answers: list[object] = []
        self.station.reload(answers.append)
        while not answers:
            self.loop.turn()
            turned()
        return answers[0]

    def refuses(self) -> StationError:
        """The error of a reload, after which a CAM is still withheld."""
        error = self.reload()
        assert isinstance(error, StationError)
        router = self.station.router
        accepted = router.accepted
        router.request(self.station.topics.by_number[2], CAM, "pull")
        assert router.accepted == accepted
        assert self.names() == ["never by air", "default"]
        return error


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with closing(Bench(tmp_path)) as bench:
        yield bench


@pytest.mark.parametrize("left", ["", "\n", " \t\r\n" * 500])
@pytest.mark.parametrize("which", ["file", "defaults"])
def test_a_reload_of_an_empty_file_is_refused(bench: Bench, left: str, which: str) -> None:
    path: Path = getattr(bench, which)
    path.write_text(left)
    assert bench.refuses().message == f"{path}: empty"


@pytest.mark.parametrize(("kind", "word"), [("pipe", "a pipe"), ("folder", "a folder"), ("device", "a device")])
def test_a_reload_of_what_is_no_regular_file_is_refused_at_once(bench: Bench, kind: str, word: str) -> None:
    bench.file.unlink()
    if kind == "pipe":
        os.mkfifo(bench.file)  # whoever opened it would wait for its writer
    elif kind == "folder":
        bench.file.mkdir()
    else:
        bench.file.symlink_to("/dev/null")
    assert bench.refuses().message == f"{bench.file}: not a regular file: {word}"


@pytest.mark.parametrize("path", ["/dev/stdin", "/dev/fd/0", "/proc/self/fd/0"])
def test_a_reload_of_a_standard_input_says_that_the_station_has_no_file_to_reload(path: str) -> None:
    program = f"from firmware.config import reload_child as it; print(next(it.answer([None, [], {path!r}, None], [])))"
    done = subprocess.run([sys.executable, "-c", program], stdin=subprocess.DEVNULL, capture_output=True, check=True)
    assert f"{path}: not a regular file: a device".encode() in done.stdout
    assert b"has no file to reload; start it with --config FILE or --board FILE" in done.stdout


def test_a_reload_of_a_socket_is_refused(bench: Bench) -> None:
    bench.file.unlink()
    with socket.socket(socket.AF_UNIX) as at, closing(at):
        at.bind(str(bench.file))
        assert "not a regular file: a socket" in bench.refuses().message


@pytest.mark.parametrize(
    ("text", "table"),
    [
        ("# all of it is a comment\n", "[interfaces]"),
        ("[station]\nname = 'x'\n", "[interfaces]"),
        (NEVER.replace("never by air", "x"), "[interfaces]"),
        ("[interfaces.air]\ndriver = 'udp'\nlisten = '127.0.0.1:0'\n", "[[policy]]"),
    ],
)
def test_a_reload_without_a_table_that_is_in_force_is_refused(bench: Bench, text: str, table: str) -> None:
    bench.file.write_text(text)
    error = bench.refuses()
    assert error.message == f"{bench.file}: {table}: missing, but the running configuration has it"
    assert "to have none, write" in error.hint


def test_a_policy_that_a_reload_brought_is_not_lost_by_the_next(bench: Bench) -> None:
    bench.file.write_text("policy = []\n" + bench.head)
    assert bench.reload() == {"rows": 0}
    bench.file.write_text(bench.head + NEVER)
    assert bench.reload() == {"rows": 1}
    bench.file.write_text(bench.head)
    bench.refuses()


def test_a_reload_takes_fewer_rows_and_logs_the_difference(bench: Bench, caplog: pytest.LogCaptureFixture) -> None:
    rows = "".join(f'[[policy]]\nname = "row {number}"\ninterfaces = []\n' for number in range(7))
    bench.file.write_text(bench.head + NEVER + rows)
    with caplog.at_level(logging.INFO, "captain"):
        bench.reload()
        bench.file.write_text(bench.head + NEVER + '[[policy]]\nname = "other"\n')
        assert bench.reload() == {"rows": 2}
    assert bench.names() == ["never by air", "other", "default"]
    assert "rows: 2, before: 8; removed: 'row 0', 'row 1', 'row 2', and 4 more; added: 'other'" in caplog.text


def test_the_difference_of_the_same_rows_is_their_number() -> None:
    assert difference(["a"], ["a"]) == "rows: 1, before: 1"


def test_of_10_000_rows_a_turn_of_the_loop_takes_a_few(bench: Bench) -> None:
    rows = "".join(f'[[policy]]\nname = "{number}"\nmatch.station = [{number}]\n' for number in range(10_000))
    bench.file.write_text(bench.head + rows)
    sizes = [0]

    def note() -> None:
        sizes.append(len(bench.station._reload._policy.rows) if bench.station._reload else 0)

    assert bench.reload(note) == {"rows": 10_000}
    assert len(bench.names()) == 10_001
    steps = [after - before for before, after in pairwise(sizes)]
    assert 0 < max(steps) <= BATCH * reload_child.BATCH


def test_a_row_longer_than_a_message_is_taken_whole(bench: Bench) -> None:
    stations = list(range(4_000_000_000, 4_000_050_000))
    bench.file.write_text(f"{bench.head}[[policy]]\nname = 'long'\nmatch.station = {stations}\n")
    assert bench.reload() == {"rows": 1}
    choose, kind = bench.station.router.policy.choose, bench.station.topics.by_number[2]
    names = [choose(kind, b"\2\2" + who.to_bytes(4, "big"), 2001, 2, None).name for who in (stations[-1], 1)]
    assert names == ["long", "default"]


def test_of_reloads_at_once_two_are_done_and_all_are_answered(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[None] = []

    class Counted(Child):
        def __init__(self, *arguments: object) -> None:
            begun.append(None)
            super().__init__(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(reload, "Child", Counted)
    answers: list[object] = []
    for _ in range(273):
        bench.station.reload(answers.append)
    while len(answers) < 273:
        bench.loop.turn()
    assert (len(begun), answers) == (2, [{"rows": 1}] * 273)


def test_a_reload_whose_process_is_killed_is_answered(bench: Bench) -> None:
    def kill() -> None:
        child = bench.station._reload._child if bench.station._reload else None
        if child is not None and not child._is_left:
            os.kill(child._process.pid, signal.SIGKILL)

    error = bench.reload(kill)
    assert isinstance(error, RequestError)
    assert "SIGKILL" in error.message
    assert bench.names() == ["never by air", "default"]
    assert bench.reload() == {"rows": 1}


def test_a_station_closes_while_it_reads_its_policy(bench: Bench) -> None:
    bench.station.reload(lambda answer: None)
    bench.station.close()
    assert bench.loop._sources == {}


def test_mistakes_of_10_000_rows_fit_into_a_message(bench: Bench) -> None:
    bench.file.write_text(bench.head + "[[policy]]\n" + "priority = 99\n" + "[[policy]]\npriority = 'é'\n" * 9_999)
    error = bench.reload()
    assert isinstance(error, ConfigurationError)
    lines = error.message.split("\n")
    assert (len(lines), lines[-1]) == (51, "9950 more mistakes; check that this is the right file")


def test_a_policy_that_grows_chooses_as_one_made_at_once(bench: Bench) -> None:
    bench.file.write_text(bench.head + "".join(f"[[policy]]\nmatch.station = [{one}]\n" for one in (1, 2, 3)))
    tables, router, topics = bench.station._source.load().tables, bench.station.router, bench.station.topics
    grown = Policy((), topics, router)
    for row in tables.policy:
        grown.extend([row])
    whole = Policy(tables.policy, topics, router)
    kind = topics.by_number[2]
    for one in range(1, 5):
        pdu = b"\2\2" + one.to_bytes(4, "big")
        found = [policy.choose(kind, pdu, 2001, 2, None).name for policy in (grown, whole)]
        assert found == [f"policy[{one - 1}]" if one < 4 else "default"] * 2
