"""Calls of the board process: those of board/README.md, and invalid ones."""

import errno
import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board import bus_calls as module
from board.bus_calls import CALLS, BlockingBusCalls, first_message, open_real_bus, read_first_message
from board.description import Hardware, IdentityDescription
from board.machine import REAL
from board.runtime.errors import InterfaceError
from drivers.sim.chips import UUID, Fault, FiledBus, World
from tests.board.boards import BOARD, make_machine
from tests.said import tells

README = Path(module.__file__).with_name("README.md").read_text()


@pytest.fixture
def machine(tmp_path):
    return make_machine(tmp_path)


@pytest.fixture
def world(machine):
    return World(BOARD, machine)


@pytest.fixture
def calls(machine):
    return BlockingBusCalls(BOARD, machine, FiledBus)


def ask(calls, do, **arguments):
    answer = json.loads(calls.answer(json.dumps({"id": 7, "do": do, **arguments}).encode()))
    assert answer.pop("id") == 7
    return answer


def value(calls, do, **arguments):
    answer = ask(calls, do, **arguments)
    assert list(answer) == ["value"], answer
    return answer["value"]


def test_the_calls_are_those_of_the_readme():
    assert set(CALLS) == {
        line.split("`")[1] for line in README.splitlines() if line.startswith("| `") and ".py" not in line
    }


def test_a_rail_is_measured_by_its_chip(calls, world):
    world.rail("main", 12.0, -1.5)
    assert value(calls, "rail", name="main") == {"v": 12.0, "a": -1.5, "w": -18.0}
    world.rail("modem", 3.304, 2.0)
    assert value(calls, "rail", name="modem") == {"v": 3.304, "a": 2.0, "w": 6.608}


def test_a_rail_that_the_kernel_measures_is_read_there(calls):
    assert value(calls, "rail", name="pi") == {"v": 5.1, "a": 0.7, "w": 3.57}


def test_temperatures_come_from_chip_and_kernel(calls, world):
    world.temperature("board", -12.25)
    assert value(calls, "temperature", name="board") == -12.25
    assert value(calls, "temperature", name="cpu") == 48.0


def test_the_fan_is_read_and_driven(calls):
    assert value(calls, "fan") == {"rpm": 4200, "percent": 50.2}
    assert value(calls, "set_fan", percent=100) is None
    assert value(calls, "fan")["percent"] == 100.0


def test_a_line_on_an_expander_is_set_and_read_as_active_or_inactive(calls, world):
    assert value(calls, "expander_get", line="modem") is False
    assert value(calls, "expander_set", line="modem", active=True) is None
    assert value(calls, "expander_get", line="modem") is True
    assert (world.is_active("modem"), world.is_active("modem_reset")) == (True, False)
    value(calls, "expander_set", line="modem_reset", active=True)
    assert world.is_active("modem_reset")


def test_a_chip_keeps_its_state_when_the_worker_is_started_anew(calls, machine):
    value(calls, "expander_set", line="modem", active=True)
    assert value(BlockingBusCalls(BOARD, machine, FiledBus), "expander_get", line="modem") is True


def test_a_pin_that_is_shorted_is_said_and_answers_again_when_it_is_not(calls, world):
    world.force("slots", 3, True)
    assert "set low, but reads high" in ask(calls, "expander_set", line="modem", active=True)["error"]
    world.force("slots", 3, None)
    assert ask(calls, "expander_set", line="modem", active=True) == {"value": None}


def test_the_identity_comes_from_the_eeprom_or_the_device_tree_or_nowhere(calls, machine):
    assert value(calls, "identity") == {
        "vendor": "captain", "product": "Quad Expander (simulated)", "product_id": "0x0001", "product_ver": "0x0001",
        "uuid": UUID, "source": "0x50 on /dev/i2c-0",
    }  # fmt: skip
    by_firmware = BlockingBusCalls(replace(BOARD, identity=IdentityDescription()), machine, FiledBus)
    assert value(by_firmware, "identity")["vendor"] == "Firmware"
    assert value(BlockingBusCalls(replace(BOARD, identity=None), machine, FiledBus), "identity") is None


def test_a_wrong_identity_is_answered_with_why(calls, world, machine):
    (machine.dev / "chips").mkdir(exist_ok=True)
    (machine.dev / "chips/id-0x50").write_bytes(b"\xff" * 4096)
    assert "not with R-Pi" in ask(calls, "identity")["error"]


def test_usb_is_switched_where_the_device_sits(calls, machine, monkeypatch):
    authorized = machine.sys / "bus/usb/devices/1-1.3/authorized"
    value(calls, "authorize", usb="1-1.3", on=False)
    assert authorized.read_text() == "0"
    value(calls, "hub_port", usb="1-1.3", on=False)
    assert (machine.sys / "bus/usb/devices/1-1:1.0/1-1-port3/disable").read_text() == "1"
    seen = []
    monkeypatch.setattr(module.usb, "reset", lambda machine, topology: seen.append(topology))
    value(calls, "reset", usb="1-1.3")
    assert seen == ["1-1.3"]


@pytest.mark.parametrize(("fault", "error"), [
    (Fault(), "no answer from 0x40 on /dev/i2c-1"),
    (Fault(110), "0x40 on /dev/i2c-1: the bus is stuck"),
    (Fault(16), "0x40 on /dev/i2c-1 is in use by the kernel"),
    (Fault(5), "0x40 on /dev/i2c-1: the transfer failed: Input/output error"),
])  # fmt: skip
def test_a_failure_is_answered_with_what_where_and_the_remedy_and_the_next_call_works(calls, world, fault, error):
    world.fail("main", 0x40, fault)
    answer = ask(calls, "rail", name="main")
    assert answer["error"] == error
    assert answer["hint"]
    world.fail("main", 0x40, None)
    assert "value" in ask(calls, "rail", name="main")


def test_bus_is_opened_once_and_again_after_a_failure(machine):
    opened = []

    def open_bus(name, hardware, machine):
        opened.append(name)
        if len(opened) == 1:
            raise InterfaceError("/dev/i2c-1: absent", "dtparam")
        return FiledBus(name, hardware, machine)

    calls = BlockingBusCalls(BOARD, machine, open_bus)
    assert ask(calls, "rail", name="main") == {"error": "/dev/i2c-1: absent", "hint": "dtparam"}
    for name in ("main", "modem"):
        value(calls, "rail", name=name)
    assert opened == ["main", "main"]


def test_bus_without_a_simulator_is_that_of_the_kernel(machine, tmp_path):
    hardware = replace(BOARD, buses={"main": replace(BOARD.buses["main"], path=str(tmp_path / "i2c-7"))})
    answer = ask(BlockingBusCalls(hardware, machine, open_real_bus), "rail", name="main")
    assert answer["error"] == f"{tmp_path}/i2c-7: {os.strerror(errno.ENOENT)}"


@pytest.mark.parametrize(("call", "words"), [
    ({"do": "rail", "name": "mian"}, "rails.mian is not declared"),
    ({"do": "temperature", "name": "main"}, "temperatures.main is not declared"),
    ({"do": "expander_set", "line": "radio", "active": True}, "lines.radio is not on an expander"),
    ({"do": "expander_get", "line": "none"}, "lines.none is not declared"),
    ({"do": "rail"}, "name: is missing"),
    ({"do": "rail", "name": 5}, "5 is an integer"),
    ({"do": "rail", "name": "main", "channel": 2}, "not a known key"),
    ({"do": "set_fan", "percent": 101}, "out of range"),
    ({"do": "set_fan", "percent": True}, "true is"),
    ({"do": "authorize", "usb": "1-1.3", "on": 1}, "1 is an integer"),
    ({"do": "authorize", "usb": "../../etc", "on": True}, ""),
    ({"do": "reset", "usb": "9-9"}, "9-9"),
    ({"do": "explode"}, "unknown call: 'explode'"),
    ({"do": None}, "unknown call: None"),
    ({}, "unknown call: None"),
])  # fmt: skip
def test_a_malformed_call_is_answered_with_what_is_wrong(calls, call, words):
    answer = json.loads(calls.answer(json.dumps({"id": "x", **call}).encode()))
    assert answer["id"] == "x"
    assert words in answer["error"]


@pytest.mark.parametrize("do", ["fan", "set_fan"])
def test_call_for_a_fan_that_is_not_declared_is_refused(machine, do):
    calls = BlockingBusCalls(replace(BOARD, fan=None), machine, FiledBus)
    arguments = {"percent": 5.0} if do == "set_fan" else {}
    assert tells(ask(calls, do, **arguments)["error"], "[fan] ", "not declared", "board file")


@given(message=st.binary(min_size=1, max_size=60) | st.text(alphabet='{}[]":,1idonull', min_size=1).map(str.encode))
def test_random_octets_are_answered(message):
    calls = BlockingBusCalls(Hardware("empty"), REAL)
    assert "error" in json.loads(calls.answer(message))


def test_a_list_nested_deeper_than_python_reads_is_answered(calls):
    assert "not a JSON object" in json.loads(calls.answer(b"[" * 60000))["error"]


def test_the_first_message_carries_the_board_and_the_machine(machine):
    assert read_first_message(first_message(BOARD, machine)) == (BOARD, machine)
    assert len(first_message(BOARD, machine)) < 65536


def test_of_a_board_file_only_the_hardware_goes_to_the_worker(machine):
    from firmware.config.board_file import Board

    board = Board(name="with interfaces", interfaces={"g5": {"driver": "udp"}})
    assert read_first_message(first_message(board, machine)) == (Hardware("with interfaces"), machine)
