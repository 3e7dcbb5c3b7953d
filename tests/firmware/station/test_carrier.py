"""A whole simulated board under its slots, in virtual time: what comes up, what fails, and what comes back."""

import errno
import json
import os
from collections.abc import Iterator
from contextlib import closing

import pytest

from board import topology
from drivers.sim.chips import Fault
from drivers.sim.radio.control import VARIABLE
from firmware.slots.supervisor import RESWITCH_S
from firmware.station import carrier as carrier_module
from firmware.station.carrier import Carrier
from firmware.station.selftest import Selftest
from tests.firmware.whole_board import NO_CLOCK, NearBoardWorker, WholeBoard
from tests.said import tells
from tests.virtual import VirtualLoop


@pytest.fixture
def board(monkeypatch: pytest.MonkeyPatch) -> Iterator[WholeBoard]:
    monkeypatch.setattr(carrier_module, "BoardWorker", NearBoardWorker)
    with closing(VirtualLoop()) as loop, closing(WholeBoard(loop)) as board:
        yield board


@pytest.fixture
def running(board: WholeBoard) -> WholeBoard:
    board.start()
    board.until_up()
    return board


def test_every_module_comes_up_through_its_slot(running: WholeBoard) -> None:
    assert {name: running.state(name) for name in running.board.slots} == {
        "gnss": "running",
        "free": "unused",
        "v2x": "unused",
        "cellular": "running",
    }
    assert running.carrier.slots["gnss"].cycles == 0


def test_a_slot_that_nobody_uses_gets_no_power(running: WholeBoard) -> None:
    world = running.simulated.world
    active = {name: world.is_active(f"slot{number}_power") for number, name in enumerate(running.board.slots, 1)}
    assert active == {"gnss": True, "free": False, "v2x": False, "cellular": True}


def test_the_receiver_says_where_the_station_is(running: WholeBoard) -> None:
    running.until(lambda: running.own_position.fix_of("gnss") is not None)
    assert running.own_position.ego().is_known
    assert running.own_position.status()["source"] == "gnss"
    assert running.own_position.mark_of("gnss") is not None


def test_identity_rails_temperatures_and_fan_are_in_the_status(running: WholeBoard) -> None:
    status = json.loads(json.dumps(running.carrier.status()))
    assert status["identity"]["product"] == "Quad Expander (simulated)"
    assert status["rails"]["supply"]["v"] == pytest.approx(12.0, abs=0.01)
    assert status["temperatures"]["cpu"]["c"] == pytest.approx(48.2)
    assert status["fan"]["rpm"] == 2640
    assert status["complaints"] == []
    assert [slot["number"] for slot in status["slots"].values()] == [1, 2, 3, 4]


def test_identity_after_a_failure_is_read_again_by_the_next_board_process(board: WholeBoard) -> None:
    board.simulated.world.fail("main", 0x50, Fault(errno.EREMOTEIO))
    board.start()
    board.until(lambda: board.carrier.unidentified)
    board.simulated.world.fail("main", 0x50, None)
    board.carrier.worker.on_state(True, "process 2 runs")
    board.until(lambda: board.carrier.identity is not None)
    assert board.carrier.unidentified == ""


def test_identity_after_a_second_failure_is_not_read_by_further_board_processes(board: WholeBoard) -> None:
    board.simulated.world.fail("main", 0x50, Fault(errno.EREMOTEIO))
    board.start()
    for _ in range(3):
        board.until(lambda: board.carrier.unidentified)
        board.carrier.worker.on_state(True, "a process runs")
    assert board.carrier.worker.asked.count("identity") == 2


def test_time_line_of_a_module_names_what_it_waited_for(running: WholeBoard) -> None:
    told = [what for who, what in running.notes if who == "slot gnss"]
    powering, starting, is_running = told
    assert tells(powering, "powering: ", "station", "started", "1546:01a9", "1-1.1")
    assert starting == "starting: 1546:01a9"
    assert tells(is_running, "running: ", "driver started", "link")


def test_a_module_that_is_pulled_out_and_put_back_comes_up_again(running: WholeBoard) -> None:
    running.simulated.unplug("gnss")
    running.until(lambda: running.state("gnss") == "powering")
    assert running.gnss.state == "waiting"
    assert running.state("cellular") == "running"
    running.simulated.plug("gnss")
    running.until_up(within=10)
    assert running.carrier.slots["gnss"].cycles == 0


def test_a_module_that_stays_away_is_a_fault_until_it_is_put_back(running: WholeBoard) -> None:
    running.simulated.unplug("gnss")
    running.until(lambda: running.state("gnss") == "fault", within=300)
    status = running.carrier.slots["gnss"].status()
    assert status["cause"] == "no USB device at 1-1.1 within 10 s"
    assert status["cycles"] == 3
    running.simulated.plug("gnss")
    running.until_up(within=15)


def test_a_receiver_that_hangs_is_cured_by_a_power_cycle(running: WholeBoard) -> None:
    running.module("gnss").is_mute = True

    def heal_without_power() -> None:
        if not running.simulated.world.is_active("slot1_power"):
            running.module("gnss").is_mute = False
        running.loop.after(0.1, heal_without_power)

    heal_without_power()
    running.until(lambda: running.state("gnss") == "cycling", within=600)
    running.until_up(within=60)
    assert running.carrier.slots["gnss"].cycles == 1


def test_a_power_cycle_by_an_operator_takes_the_modules_power(running: WholeBoard) -> None:
    boots = running.module("cellular").boots
    running.carrier.slots["cellular"].operate("cycle")
    running.until_up()
    assert running.module("cellular").boots == boots + 1


def test_an_expander_that_does_not_answer_is_a_fault_with_its_name_and_touches_nobody_else(running: WholeBoard) -> None:
    running.simulated.world.fail("main", 0x20, Fault(errno.EREMOTEIO))
    running.carrier.slots["gnss"].operate("cycle")
    running.until(lambda: running.state("gnss") == "fault", within=120)
    assert "0x20" in str(running.carrier.slots["gnss"].status()["cause"])
    assert (running.state("cellular"), running.cellular.state) == ("running", "up")
    running.simulated.world.fail("main", 0x20, None)
    running.carrier.slots["gnss"].operate("on")
    running.until_up(within=30)


def test_a_slot_whose_power_could_not_be_switched_on_gets_it_when_the_bus_is_back(running: WholeBoard) -> None:
    running.carrier.slots["gnss"].operate("cycle")
    running.until(lambda: not running.simulated.world.is_active("slot1_power"), within=5)
    running.simulated.world.fail("main", 0x20, Fault(errno.EREMOTEIO))
    running.until(lambda: running.state("gnss") == "fault", within=120)
    running.loop.run_for(100)
    assert (running.state("gnss"), running.simulated.world.is_active("slot1_power")) == ("fault", False)
    running.simulated.world.fail("main", 0x20, None)
    running.until_up(within=RESWITCH_S + 15)


def test_a_rail_out_of_its_limits_is_complained_of(running: WholeBoard) -> None:
    running.simulated.world.rail("supply", 8.2, 1.0)
    running.until(lambda: running.carrier.status()["complaints"] != [], within=10)
    (said,) = running.carrier.status()["complaints"]
    assert said == "rail supply: 8.2 V is below 9 V"


def test_a_stop_leaves_every_module_its_power(running: WholeBoard) -> None:
    running.carrier.close()
    running.loop.run_for(60)
    assert running.simulated.world.is_active("slot1_power")
    assert running.module("gnss").boots == 1


def test_a_second_start_of_the_station_cycles_no_module(running: WholeBoard) -> None:
    running.carrier.close()
    running.loop.run_for(5)
    again = Carrier(
        running.loop,
        running.board,
        running.simulated.machine,
        {"gnss": running.gnss, "cellular": running.cellular},
        lambda who, what: None,
        "sim-board",
    )
    running.carrier = again
    again.start()
    running.until_up(within=20)
    assert running.module("gnss").boots == 1
    assert running.module("cellular").boots == 1


def rows_of(running: WholeBoard) -> dict[str, dict[str, object]]:
    answers: list[dict[str, object]] = []
    interfaces = {"gnss": running.gnss, "cellular": running.cellular}
    Selftest(running.loop, running.carrier, interfaces, running.own_position, lambda: NO_CLOCK, answers.append).start()
    running.until(lambda: bool(answers), within=30)
    (answer,) = answers
    return {row["capability"]: row for row in answer["rows"]}


def test_a_self_test_that_is_asked_for_at_the_start_waits_until_all_is_up(board: WholeBoard) -> None:
    board.start()
    rows = rows_of(board)
    assert [name for name, row in rows.items() if row["works"] is False] == []
    wanted = {"identity", "rail supply", "temperature cpu", "fan", "hot-plug", "line slot4_reset", "slot cellular"}
    assert wanted | {"interface gnss", "position gnss", "time mark gnss"} <= set(rows)
    assert rows["rail supply"]["value"] == "12 V, 1.25 A, 15 W"


def test_a_self_test_names_what_does_not_work_with_a_remedy(running: WholeBoard) -> None:
    running.simulated.world.fail("main", 0x41, Fault(errno.EREMOTEIO))
    running.simulated.world.fail("main", 0x20, Fault(errno.EREMOTEIO))
    running.simulated.unplug("gnss")
    running.loop.run_for(7)
    rows = rows_of(running)
    wrong = {name: row for name, row in rows.items() if row["works"] is False}
    assert {"rail slots_3v3", "slot gnss", "interface gnss", "position gnss", "line slot1_power"} <= set(wrong)
    assert all(row["remedy"] for row in wrong.values())
    assert wrong["rail slots_3v3"]["is_present"] is False
    assert rows["slot cellular"]["works"]


def test_a_simulated_board_leaves_the_environment_to_who_starts_it(running: WholeBoard) -> None:
    assert VARIABLE not in os.environ
    assert running.simulated.environment[VARIABLE].startswith("listen=127.0.0.1:")


def test_every_slot_of_the_simulated_board_is_a_port_of_one_hub(board: WholeBoard) -> None:
    assert {topology.parse(slot.usb).hub for slot in board.board.slots.values()} == {"1-1"}
