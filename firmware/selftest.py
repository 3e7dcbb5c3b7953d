"""Each thing that is declared, looked at once everything has come up: `captain selftest`. Nothing is switched."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from board.loop import Loop
from drivers.contract import Answer, Can
from firmware import capability
from firmware.capability import Row
from firmware.carrier import Carrier
from firmware.place import Place
from firmware.slot_states import State
from firmware.supervisor import Supervised

# What has not come up by then is told as it is; the whole answer comes within 30 s.
SETTLE_S = 25.0
LOOK_S = 0.25
ON_ITS_WAY = frozenset({State.STOPPED, State.POWERING, State.STARTING, State.CYCLING})


class Selftest:
    """One run; answer is given {"rows": [...]} once. clock gives the status of the time."""

    def __init__(
        self,
        loop: Loop,
        carrier: Carrier | None,
        interfaces: Mapping[str, Supervised],
        place: Place,
        clock: Callable[[], Mapping[str, Any]],
        answer: Answer,
    ) -> None:
        self._loop = loop
        self._carrier = carrier
        self._interfaces = interfaces
        self._place = place
        self._clock = clock
        self._answer = answer
        self._until = loop.clock() + SETTLE_S
        self._lines: dict[str, Row | None] = {}  # of expanders; None: not read yet

    def start(self) -> None:
        """Wait until nothing is on its way up any more, then look."""
        if self._loop.clock() < self._until and any(is_pending() for is_pending in self._pending()):
            self._loop.after(LOOK_S, self.start)
            return
        carrier = self._carrier
        described = carrier.hardware.lines if carrier else {}
        self._lines = {name: None for name, line in described.items() if line.expander}
        for name in self._lines:
            assert carrier is not None
            carrier.remote.ask("expander_get", {"line": name}, partial(self._read, name))
        self._finish()

    def _pending(self) -> tuple[Callable[[], bool], ...]:
        return self._slots_are_pending, self._links_are_pending, self._measurements_are_pending, self._time_is_pending

    def _slots_are_pending(self) -> bool:
        return self._carrier is not None and any(slot.state in ON_ITS_WAY for slot in self._carrier.slots.values())

    def _links_are_pending(self) -> bool:
        return any(self._is_pending(name, one) for name, one in self._interfaces.items())

    def _is_pending(self, name: str, one: Supervised) -> bool:
        """Whether its link may yet come up, or its receiver see the sky and know the time."""
        if one.state != "up":
            return one.state != "stopped"
        can, mark = one.interface.driver.capabilities.can, self._place.mark_of(name)
        is_unlocked = Can.TIMEMARK in can and not (mark and mark.is_locked)
        return is_unlocked or (Can.POSITION in can and self._place.fix_of(name) is None)

    def _measurements_are_pending(self) -> bool:
        return self._carrier is not None and not self._carrier.is_measured

    def _time_is_pending(self) -> bool:
        """Whether pulses may yet tell the time: their input is open, and a receiver is there that announces them."""
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
            rows += capability.of_interface(name, one, self._place)
        rows += capability.of_time(self._clock())
        self._answer({"rows": [row._asdict() for row in rows]})
