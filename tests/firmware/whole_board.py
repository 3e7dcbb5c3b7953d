"""The simulated board under slots and drivers, all in one process and on a clock that jumps."""

import json
from collections.abc import Callable, Mapping
from typing import Any

from board.bus_calls import BlockingBusCalls
from board.description import Hardware
from board.machine import Machine
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop
from board.time.scales import Fix, TimeMark
from drivers.contract import Driver, Shared
from drivers.gnss.driver import GnssOptions, ZedF9p
from drivers.sim.board import SimulatedBoard
from drivers.sim.chips import FiledBus
from drivers.sim8202g.driver import ModemOptions, Sim8202g
from firmware.config import board_file
from firmware.config.tables import QueueOptions
from firmware.routing.drops import Drops
from firmware.routing.interface import Interface, InterfaceListener
from firmware.station.carrier import Carrier
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.position import OwnPosition
from firmware.station.simulation import Simulation
from firmware.topics import Topics
from tests.firmware.doubles import NotingStation
from tests.virtual import VirtualLoop

NO_CLOCK = {"pulse": None, "state": "system", "uncertainty_ns": None}  # of a station without pulses
MAC = bytes.fromhex("02000000000b")


class NearBoardWorker:
    """board.board_worker.BoardWorker without a process: calls are done at once, and answered in the next turn."""

    def __init__(
        self, loop: Loop, hardware: Hardware, machine: Machine, worker: str, on_state: Callable[[bool, str], None]
    ) -> None:
        self.worker = worker
        self.on_state = on_state
        self.asked: list[str] = []
        self._loop = loop
        self._calls = BlockingBusCalls(hardware, machine, FiledBus)

    def start(self) -> None: ...

    def finish(self) -> None: ...

    def ask(self, do: str, arguments: Mapping[str, object], done: Callable[[Any], None]) -> None:
        self.asked.append(do)
        answer = json.loads(self._calls.answer(json.dumps({"id": 1, "do": do, **arguments}).encode()))
        outcome = InterfaceError(answer["error"], answer["hint"]) if "error" in answer else answer["value"]
        self._loop.soon(lambda: done(outcome))

    def status(self) -> dict[str, object]:
        return {"is_up": True}


class PositionListener(InterfaceListener):
    """Passes fixes and time marks of one interface to the own position."""

    def __init__(self, name: str, own_position: OwnPosition) -> None:
        self._name = name
        self._own_position = own_position

    def fix(self, fix: Fix) -> None:
        self._own_position.fix(self._name, fix)

    def time_mark(self, mark: TimeMark) -> None:
        self._own_position.time_mark(self._name, mark)


class WholeBoard:
    """A receiver and a modem in their slots; the radio's slot has nobody who would start it."""

    def __init__(self, loop: VirtualLoop) -> None:
        self.loop = loop
        self.board = board_file.load("sim")
        self.simulation = Simulation(loop, self.board)
        assert self.simulation.board is not None
        self.simulated: SimulatedBoard = self.simulation.board
        self.above = NotingStation()
        self.own_position = OwnPosition(loop.clock, None, is_mobile=True)
        self.notes: list[tuple[str, str]] = []
        shared = Shared(MAC, machine=self.simulated.machine)
        self.gnss = self._supervised("gnss", ZedF9p(GnssOptions(usb="1-1.1"), shared))
        self.cellular = self._supervised("cellular", Sim8202g(ModemOptions(usb="1-1.4", bearer="none"), shared))
        self.carrier = Carrier(
            loop,
            self.board,
            self.simulated.machine,
            {"gnss": self.gnss, "cellular": self.cellular},
            lambda who, what: self.notes.append((who, what)),
            "sim-board",
        )

    def _supervised(self, name: str, driver: Driver) -> InterfaceSupervisor:
        interface = Interface(name, driver, QueueOptions(name, slot=name), self.loop, self.above, Topics(), Drops())
        interface.listener = PositionListener(name, self.own_position)
        return InterfaceSupervisor(self.loop, interface, lambda: 0.5)

    def start(self) -> None:
        self.simulated.start()
        self.carrier.start()

    def until(self, is_so: Callable[[], bool], within: float = 120.0) -> None:
        self.loop.run_until(is_so, within)

    def until_up(self, within: float = 120.0) -> None:
        self.until(lambda: self.gnss.state == self.cellular.state == "up", within)

    def state(self, slot: str) -> str:
        return self.carrier.slots[slot].state.value

    def module(self, slot: str) -> Any:
        """The simulator in a slot."""
        return self.simulated.modules[slot].plays

    def close(self) -> None:
        self.carrier.close()
        self.simulated.close()
