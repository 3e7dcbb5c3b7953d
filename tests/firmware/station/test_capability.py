"""Self-test rows of a receiver, a bearer and a slot."""

from typing import Any

import pytest

from board.runtime.errors import InterfaceError
from board.time.scales import Fix, FixKind, TimeMark
from drivers.contract import Can
from firmware.station.capability import Row, of_interface, of_slot, of_time
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.position import OwnPosition
from tests.firmware.doubles import NotingStation, ScriptedDriver, interface_of
from tests.virtual import VirtualLoop

SLOT = {"interface": None, "state": "unused", "device": "", "why": "", "cause": "", "hint": ""}


@pytest.fixture
def own_position(loop: VirtualLoop) -> OwnPosition:
    return OwnPosition(loop.clock, None, is_mobile=True)


def running(loop: VirtualLoop, can: Can) -> InterfaceSupervisor:
    supervised = InterfaceSupervisor(loop, interface_of(loop, NotingStation(), ScriptedDriver(can)))
    supervised.start()
    return supervised


def row(word: str, one: InterfaceSupervisor, own_position: OwnPosition) -> Row:
    (found,) = (row for row in of_interface("g5", one, own_position) if row.capability == f"{word} g5")
    return found


def mark(loop: VirtualLoop, is_locked: bool) -> TimeMark:
    return TimeMark(loop.clock(), 1_782_000_000, 25, 3, is_locked, 18)


def test_a_time_mark_works_while_it_is_fresh_and_locked(loop: VirtualLoop, own_position: OwnPosition) -> None:
    one = running(loop, Can.TIMEMARK)
    assert (row("time mark", one, own_position).works, row("time mark", one, own_position).value) == (False, "none")
    own_position.time_mark("g5", mark(loop, is_locked=False))
    assert (row("time mark", one, own_position).works, row("time mark", one, own_position).value) == (
        False,
        "25 ns, not locked",
    )
    own_position.time_mark("g5", mark(loop, is_locked=True))
    assert (row("time mark", one, own_position).works, row("time mark", one, own_position).value) == (
        True,
        "25 ns, locked",
    )
    loop.run_for(3600)
    assert (row("time mark", one, own_position).works, row("time mark", one, own_position).value) == (False, "none")


def test_a_position_works_while_it_is_fresh(loop: VirtualLoop, own_position: OwnPosition) -> None:
    one = running(loop, Can.POSITION)
    own_position.fix("g5", Fix(loop.clock(), FixKind.FULL, 487_000_000, 114_000_000, horizontal=1500))
    assert row("position", one, own_position).works is True
    loop.run_for(3600)
    assert row("position", one, own_position).works is False


def test_bearer_works_with_its_signal_and_address(loop: VirtualLoop, own_position: OwnPosition) -> None:
    one = running(loop, Can.BEARER)
    without = row("bearer", one, own_position)
    assert without[:4] == ("bearer g5", True, False, "no signal, no address")
    assert "coverage" in without.remedy
    assert "`captain modem status`" in without.ask
    one.interface.report_details({"rssi_dbm": -71, "addresses": ["10.0.0.2"]})
    assert row("bearer", one, own_position) == Row("bearer g5", True, True, "-71 dBm, 10.0.0.2")
    one.interface.link(False, "no network")
    assert row("bearer", one, own_position).works is False


@pytest.mark.parametrize(
    ("slot", "works", "value"),
    [
        ({}, None, "empty"),
        ({"device": "1e0e:9001"}, True, "unused: 1e0e:9001"),
        ({"state": "fault", "why": "power on: no answer"}, False, "fault: empty"),
        ({"interface": "g5", "state": "running", "device": "1e0e:9001"}, True, "running: 1e0e:9001"),
        ({"interface": "g5", "state": "powering", "why": "driver gone"}, False, "powering: driver gone"),
    ],
)
def test_an_empty_slot_that_nobody_uses_is_empty_and_neither_works_nor_does_not(
    slot: dict[str, Any], works: bool | None, value: str
) -> None:
    found = of_slot("free", {**SLOT, **slot})
    assert (found.works, found.value) == (works, value)


def test_slot_that_does_not_work_gives_its_cause_and_the_command_to_cycle_it(loop: VirtualLoop) -> None:
    fault = {"interface": "g5", "state": "fault", "cause": "no answer from 0x20", "hint": "is it plugged in?"}
    found = of_slot("v2x", {**SLOT, **fault})
    assert found.remedy == f"{fault['cause']} ({fault['hint']})"
    assert "`captain slot cycle v2x`" in found.ask


def test_what_a_link_misses_is_said_once_and_what_hangs_on_it_refers_to_it(
    loop: VirtualLoop, own_position: OwnPosition
) -> None:
    def start(host: object) -> None:
        raise InterfaceError("no library at /x", "install the vendor's package")

    driver = ScriptedDriver(Can.POSITION | Can.TIMEMARK | Can.BEARER)
    one = InterfaceSupervisor(loop, interface_of(loop, NotingStation(), driver))
    driver.on_start = start
    one.start()
    remedies = {row.capability.split()[0]: row.remedy for row in of_interface("g5", one, own_position)}
    first = "first: interface g5"
    assert remedies == {
        "interface": "install the vendor's package",
        "position": first,
        "time": first,
        "bearer": first,
    }
    one.stop()


CLOCK: dict[str, Any] = {
    "state": "locked",
    "uncertainty_ns": 5_190,
    "pulse": {"is_open": True, "age_s": 0.4, "taken": 12, "seconds": 8, "why": "", "hint": ""},
}


def test_a_station_without_an_input_has_no_row_of_pulses() -> None:
    assert list(of_time(CLOCK | {"pulse": None})) == []


def test_pulses_and_time_work_while_they_come_and_are_believed() -> None:
    assert list(of_time(CLOCK)) == [
        Row("pulses", True, True, "12 taken, 8 good"),
        Row("time", True, True, "locked, within 5.2 us"),
    ]


@pytest.mark.parametrize(
    ("pulse", "state", "works", "remedies"),
    [
        ({"is_open": False, "why": "gone", "hint": "load it"}, "coarse", [False, False], ["load it", "first: pulses"]),
        ({"age_s": None}, "coarse", [False, False], ["wire the time pulse of the receiver", "first: its receiver"]),
        ({"age_s": 60.0}, "holdover", [False, True], ["wire the time pulse of the receiver", ""]),
        ({}, "coarse", [True, False], ["", "`captain time` says why pulses are refused"]),
    ],
)
def test_what_does_not_work_says_what_to_do(
    pulse: dict[str, Any], state: str, works: list[bool], remedies: list[str]
) -> None:
    told = CLOCK["pulse"] | {"age_s": None} | pulse if "is_open" in pulse else CLOCK["pulse"] | pulse
    rows = list(of_time(CLOCK | {"state": state, "pulse": told}))
    assert [row.works for row in rows] == works
    assert all(row.remedy.startswith(remedy) for row, remedy in zip(rows, remedies, strict=True))
