"""Station on the simulated board: radio and receiver start in slots, fail and return."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest
import zmq

from firmware.config.board_file import BOARDS
from tests.system.conftest import Launcher
from tests.system.station import PROGRAM, Station
from tests.system.user import Reports, User

# The modem is left out, because it needs ten seconds to find a network and has tests of its own.
WITHOUT = "[interfaces.cellular]"
BY_PULSES = ("settling", "locked")
ITS_EPOCH = 1_072_915_200  # Unix time of 2004-01-01
MODULES_S = 30.0  # timeout until the other modules are up, on a busy machine


class Bench:
    """Station on a simulated board with ports of its own, and a user."""

    def __init__(self, launch: Launcher, folder: Path) -> None:
        text = (BOARDS / "sim.toml").read_text()
        before, found, after = text.partition(WITHOUT)
        assert found
        text = (before + after[after.index("[neighbours]") :]).replace("off_s = 1.0", "off_s = 0.1")
        for usual in ("8947", "8949"):
            text = text.replace(f"127.0.0.1:{usual}", f"127.0.0.1:{launch.port()}")
        board = folder / "board.toml"
        board.write_text(text)
        self.station: Station = launch.station()
        self.station.configure({})
        self.station.start("--board", str(board))
        self.user: User = launch.user(self.station)

    def slot(self, name: str) -> dict[str, Any]:
        found: dict[str, Any] = self.station.status()["board"]["slots"][name]
        return found

    def until_up(self) -> dict[str, Any]:
        return self.station.until(
            lambda status: all(one["state"] == "up" for one in status["interfaces"].values()), MODULES_S
        )

    def captain(self, *words: str) -> tuple[int, Any]:
        """Run a command with JSON output; return its exit status and its output."""
        command = [*PROGRAM, *words, "--json", "--control", str(self.station.control)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
        assert done.stdout, done.stderr
        return done.returncode, json.loads(done.stdout)

    def workers(self) -> dict[str, int]:
        """Return the process ids of the station's workers, by name."""
        pid = self.station.status()["pid"]  # not that of the started process, which only unpacks in the one-file form
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        words = {int(child): Path(f"/proc/{child}/cmdline").read_text().split("\0") for child in children}
        return {line[line.index("--worker") + 1]: child for child, line in words.items() if "--worker" in line}


@pytest.fixture(scope="module")
def bench(launch_shared: Launcher, tmp_path_factory: pytest.TempPathFactory) -> Bench:
    bench = Bench(launch_shared, tmp_path_factory.mktemp("board"))
    bench.until_up()
    return bench


@pytest.fixture(scope="module", autouse=True)
def timed(launch_shared: Launcher, tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Return a second, undisturbed station, which receives pulses while the first one is tested."""
    return Bench(launch_shared, tmp_path_factory.mktemp("timed"))


def test_radio_and_receiver_come_up_through_their_slots(bench: Bench) -> None:
    assert {name: bench.slot(name)["state"] for name in ("gnss", "free", "v2x", "cellular")} == {
        "gnss": "running",
        "free": "unused",
        "v2x": "running",
        "cellular": "unused",
    }


def test_neighbours_are_heard_by_the_radio(bench: Bench) -> None:
    bench.station.until(lambda status: status["interfaces"]["g5"]["received"].get("cam", 0) > 0)


def test_the_receivers_position_is_the_stations(bench: Bench) -> None:
    status = bench.station.until(lambda status: status["position"]["source"] == "gnss")
    assert status["position"]["fix"] == "full"
    assert status["position"]["latitude"] == pytest.approx(48.767, abs=0.01)


def test_the_worker_of_the_board_may_be_killed(bench: Bench) -> None:
    bench.station.until(lambda status: status["board"]["rails"]["supply"]["age_s"] is not None)
    os.kill(bench.workers()["sim-board"], signal.SIGKILL)
    bench.station.until(lambda status: status["board"]["worker"]["restarts"] > 0 and status["board"]["worker"]["is_up"])
    assert bench.until_up()["board"]["rails"]["supply"]["v"] == pytest.approx(12.0)


def test_a_crash_of_the_radios_library_costs_that_interface_a_restart_and_nothing_else(bench: Bench) -> None:
    before = bench.station.status()["interfaces"]
    os.kill(bench.workers()["som301e"], signal.SIGKILL)
    after = bench.station.until(
        lambda status: (
            status["interfaces"]["g5"]["restarts"] > before["g5"]["restarts"]
            and status["interfaces"]["g5"]["state"] == "up"
        )
    )["interfaces"]
    assert after["gnss"]["restarts"] == before["gnss"]["restarts"]
    assert bench.slot("v2x")["cycles"] == 0


def test_a_power_cycle_of_one_slot_touches_no_other(bench: Bench) -> None:
    code, slots = bench.captain("slot", "cycle", "gnss", "--wait")
    assert (code, slots["gnss"]["state"], slots["gnss"]["cycles"]) == (0, "running", 1)
    assert bench.until_up()["board"]["slots"]["v2x"]["cycles"] == 0


def test_a_slot_that_is_switched_off_loses_its_device_until_it_is_switched_on(bench: Bench) -> None:
    assert bench.captain("slot", "off", "1")[0] == 0
    status = bench.station.until(lambda status: status["interfaces"]["gnss"]["state"] == "waiting")
    assert status["interfaces"]["gnss"]["why"] == "slot gnss: off: by an operator"
    assert bench.captain("slot", "on", "1", "--wait")[1]["gnss"]["state"] == "running"
    bench.until_up()


def test_the_board_is_shown_with_the_time_line_of_the_start(bench: Bench) -> None:
    code, told = bench.captain("board", "show")
    assert code == 0
    assert told["board"]["identity"]["vendor"] == "captain"
    who = [row["who"] for row in told["timeline"]]
    assert {"slot gnss", "slot v2x", "g5", "gnss"} <= set(who)


def test_a_driver_is_asked_over_the_control_socket(bench: Bench) -> None:
    answer = bench.station.ask(do="operate", interface="gnss", ask="status", arguments={})
    assert answer["ok"], answer
    refused = bench.station.ask(do="operate", interface="g5", ask="status")
    assert refused["error"] == "interface g5 (som301e) accepts no commands"


def _is_exact(clock: dict[str, Any]) -> bool:
    return clock["state"] in BY_PULSES and clock["uncertainty_ns"] < 1_000_000


def test_pulses_tell_the_time_and_say_how_well(timed: Bench) -> None:
    # `locked` takes 15 s and is tested in virtual time: tests/firmware/station/test_station_time.py.
    # On a busy machine, the first pulses may be processed late, which the station reports.
    clock = timed.station.until(lambda status: _is_exact(status["clock"]), MODULES_S)["clock"]
    assert clock["error_ns"] == abs(clock["offset_ns"]) + clock["uncertainty_ns"]
    assert (clock["receiver"], clock["pulse"]["is_open"], clock["missing"]) == ("gnss", True, "")
    assert clock["its_ms"] / 1000 == pytest.approx(time.time() - ITS_EPOCH + clock["leap"]["seconds"], abs=2.0)


def test_the_time_is_told_by_a_command(timed: Bench, tmp_path: Path) -> None:
    code, told = timed.captain("time", "--history")
    assert code == 0
    assert told["state"] in BY_PULSES
    assert told["history"]["seconds"]
    timed.station.until(lambda status: status["clock"]["pulse"]["seconds"] >= 2, MODULES_S)
    command = [*PROGRAM, "time", "--plot", str(tmp_path / "time.svg"), "--control", str(timed.station.control)]
    subprocess.run(command, check=True, timeout=20, capture_output=True)
    assert (tmp_path / "time.svg").read_text().startswith("<svg")


def test_every_message_has_the_quality_of_its_time(timed: Bench) -> None:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    reports = Reports(context, timed.station, b"indication.cam.")
    said = reports.next("indication.cam.")[1]
    reports.close()
    context.term()
    assert said["interface"] == "g5"
    assert said["quality"]["state"] in BY_PULSES
    assert said["quality"]["error_ns"] < 1_000_000_000


def test_the_self_test_passes(timed: Bench) -> None:
    timed.station.until(lambda status: status["position"]["source"] == "gnss")
    answer = timed.station.ask(do="selftest", within_s=30)
    assert [row for row in answer["rows"] if row["works"] is False] == []


def test_it_ends_with_its_workers_and_leaves_no_files(
    launch: Launcher, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wait_for_end: Any
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    bench = Bench(launch, tmp_path)
    bench.until_up()
    workers = bench.workers().values()
    bench.station.stop()
    for pid in workers:
        wait_for_end(pid)
    assert list(tmp_path.glob("captain-sim-*")) == []
