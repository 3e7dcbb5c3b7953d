"""Workers of the program under test: from source or frozen, as $CAPTAIN selects."""

import json
import os
import re
import select
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from board.runtime.child import MAX_MESSAGE
from board.runtime.worker import Worker
from tests.system.conftest import Launcher
from tests.system.station import PROGRAM
from tests.virtual import VirtualLoop


class Nest:
    """Worker that has a worker itself: `captain --worker prove-nesting`, which starts `captain --worker echo`."""

    def __init__(self) -> None:
        self.loop = VirtualLoop(patience_s=20.0)
        self.told: list[bytes] = []
        self.states: list[str] = []
        self.worker = Worker(
            self.loop,
            "prove-nesting",
            on_message=self.told.append,
            on_state=lambda is_up, why: self.states.append(why),
            command=PROGRAM,
        )
        self.worker.start()

    def next(self, start: bytes) -> bytes:
        """Return the rest of the next message that begins with `start`."""
        found: list[bytes] = []

        def is_there() -> bool:
            found[:] = [message for message in self.told if message.startswith(start)]
            return bool(found)

        self.loop.run_until(is_there)
        self.told.remove(found[0])
        return found[0].removeprefix(start)

    def echo_pid(self) -> int:
        return int(re.findall(rb"process (\d+) runs", self.next(b"state "))[0])

    def close(self) -> None:
        self.worker.finish(within=5.0)
        self.loop.close()


@pytest.fixture
def nest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Nest]:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    nest = Nest()
    yield nest
    nest.close()
    assert os.listdir(tmp_path) == [], "the one-file form leaves what it has unpacked"


def parent_of(pid: int) -> int:
    return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])


def command_of(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/cmdline").read_text().split("\0")


def test_a_worker_of_the_program_takes_messages_of_every_allowed_length(nest: Nest):
    nest.echo_pid()
    for octets in (b"\0", bytes(range(256)), b"x" * (MAX_MESSAGE - 5)):
        nest.worker.send(octets)
        assert nest.next(b"echo ") == octets


def test_a_worker_is_one_process_whose_parent_is_the_program(nest: Nest):
    # In the one-file form there could be two processes: a boot loader that unpacks again, and the worker as its child.
    pid = nest.echo_pid()
    assert command_of(pid)[-4:-2] == ["--worker", "echo"]
    assert command_of(parent_of(pid))[-4:-2] == ["--worker", "prove-nesting"]


def test_a_killed_worker_is_started_again(nest: Nest):
    pid = nest.echo_pid()
    os.kill(pid, signal.SIGKILL)
    assert re.search(rb"ended, SIGKILL; starts again in 0\.[12] s", nest.next(b"state "))
    assert nest.echo_pid() != pid
    nest.worker.send(b"again")
    assert nest.next(b"echo ") == b"again"


def test_a_worker_ends_with_its_parent_even_when_that_is_killed(nest: Nest, wait_for_end: Callable[[int], None]):
    pid = nest.echo_pid()
    os.kill(parent_of(pid), signal.SIGKILL)
    wait_for_end(pid)
    nest.loop.run_until(lambda: not nest.worker.is_up)


def test_a_stopped_worker_takes_its_own_worker_along(nest: Nest, wait_for_end: Callable[[int], None]):
    pid = nest.echo_pid()
    nest.worker.stop()
    wait_for_end(pid)


def test_doctor_tries_a_worker_out():
    told = subprocess.run([*PROGRAM, "doctor", "--json"], capture_output=True, timeout=60, check=False)
    (finding,) = [row for row in json.loads(told.stdout) if row["subject"] == "worker"]
    assert finding["level"] == "ok"
    assert re.fullmatch(r"a child process answered after \d+ ms", finding["text"])


def test_a_station_whose_started_process_is_killed_does_not_live_on(launch: Launcher) -> None:
    # In the one-file form, the started process only unpacks the program; the station is its child.
    bench = launch("pdu")
    assert bench.station.child is not None
    station = os.pidfd_open(bench.station.status()["pid"])
    bench.station.kill()
    with select.epoll() as epoll:
        epoll.register(station, select.EPOLLIN)
        assert epoll.poll(10.0)
    os.close(station)
