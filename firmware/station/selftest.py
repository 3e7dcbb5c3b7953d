"""Self-test: collects all capabilities once every part is up; switches nothing."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from board.runtime.loop import Loop
from drivers.contract import Answer, Can
from firmware.slots.states import SlotState
from firmware.station import capability
from firmware.station.capability import Row
from firmware.station.carrier import Carrier
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.position import OwnPosition

# Seconds. After this time, the parts are reported in their current state, so that the answer comes within 30 s.
SETTLE_S = 25.0
LOOK_S = 0.25
ON_ITS_WAY = frozenset({SlotState.STOPPED, SlotState.POWERING, SlotState.STARTING, SlotState.CYCLING})


class Selftest:
    """Run of the self-test.

    carrier     carrier board; None without hardware.
    interfaces  supervisors of the interfaces, by name.
    clock       returns the status of the time.
    answer      receives {"rows": [...]} once.
    """

    def __init__(
        self,
        loop: Loop,
        carrier: Carrier | None,
        interfaces: Mapping[str, InterfaceSupervisor],
        own_position: OwnPosition,
        clock: Callable[[], Mapping[str, Any]],
        answer: Answer,
    ) -> None:
        self._loop = loop
        self._carrier = carrier
        self._interfaces = interfaces
        self._own_position = own_position
        self._clock = clock
        self._answer = answer
        self._until = loop.clock() + SETTLE_S
        self._lines: dict[str, Row | None] = {}  # rows of the lines of I/O expanders; None until the line was read

    def start(self) -> None:
        """Wait until no part is starting any more, at most SETTLE_S, then collect the rows."""
        if self._loop.clock() < self._until and any(is_pending() for is_pending in self._pending()):
            self._loop.after(LOOK_S, self.start)
            return
        carrier = self._carrier
        described = carrier.hardware.lines if carrier else {}
        self._lines = {name: None for name, line in described.items() if line.expander}
        for name in self._lines:
            assert carrier is not None
            carrier.worker.ask("expander_get", {"line": name}, partial(self._read, name))
        self._finish()

    def _pending(self) -> tuple[Callable[[], bool], ...]:
        return self._slots_are_pending, self._links_are_pending, self._measurements_are_pending, self._time_is_pending

    def _slots_are_pending(self) -> bool:
        return self._carrier is not None and any(slot.state in ON_ITS_WAY for slot in self._carrier.slots.values())

    def _links_are_pending(self) -> bool:
        return any(self._is_pending(name, one) for name, one in self._interfaces.items())

    def _is_pending(self, name: str, one: InterfaceSupervisor) -> bool:
        """Return True while an interface may still change: its link is not up, or its receiver has no fix or time."""
        if one.state != "up":
            return one.state != "stopped"
        can, mark = one.interface.driver.capabilities.can, self._own_position.mark_of(name)
        is_unlocked = Can.TIMEMARK in can and not (mark and mark.is_locked)
        return is_unlocked or (Can.POSITION in can and self._own_position.fix_of(name) is None)

    def _measurements_are_pending(self) -> bool:
        return self._carrier is not None and not self._carrier.is_measured

    def _time_is_pending(self) -> bool:
        """Return True while the pulse input is open and the clock has no time by pulses yet."""
        clock = self._clock()
        return bool(clock["pulse"] and clock["pulse"]["is_open"]) and clock["state"] not in capability.TOLD

    def _read(self, name: str, outcome: object) -> None:
        self._lines[name] = capability.of_expander_line(name, outcome)
        self._finish()

    def _finish(self) -> None:
        lines = [row for row in self._lines.values() if row is not None]
        if len(lines) < len(self._lines):
            return
        rows = [*(capability.of_board(self._carrier) if self._carrier else ()), *lines]
        for name, one in self._interfaces.items():
            rows += capability.of_interface(name, one, self._own_position)
        rows += capability.of_time(self._clock())
        self._answer({"rows": [row._asdict() for row in rows]})
