"""Operator commands of the control socket: operate, slot, board, selftest."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from board.runtime.errors import RequestError
from board.runtime.loop import Loop
from drivers.contract import Answer, Operated
from firmware.endpoint.control.question import Command, Later, Question, text
from firmware.station.interface_supervisor import InterfaceSupervisor
from firmware.station.position import OwnPosition
from firmware.station.timeline import Timeline

if TYPE_CHECKING:
    from firmware.station.carrier import Carrier


class Operator:
    """Commands `operate`, `slot`, `board` and `selftest` of the control socket.

    interfaces  supervisors of the interfaces, by name.
    carrier     returns the carrier board; None without hardware.
    clock       returns the status of the time.
    """

    def __init__(
        self,
        loop: Loop,
        interfaces: Mapping[str, InterfaceSupervisor],
        carrier: Callable[[], "Carrier | None"],
        own_position: OwnPosition,
        clock: Callable[[], Mapping[str, Any]],
        timeline: Timeline,
    ) -> None:
        self._loop = loop
        self._own_position = own_position
        self._clock = clock
        self._interfaces = interfaces
        self._carrier = carrier
        self._timeline = timeline

    @property
    def now(self) -> dict[str, Command]:
        return {"slot": self.slot, "board": self.board}

    @property
    def later(self) -> dict[str, Later]:
        return {"operate": self.operate, "selftest": self.selftest}

    def slot(self, question: Question) -> dict[str, object]:
        """Answer {"do": "slot", "ask": "list"}, or switch a slot: "ask" is "on", "off" or "cycle".

        To switch, "slot" is the name of a slot, or its number from 1. The answer has the status of the slots.

        Raises RequestError if the board has no slots, and for an unknown slot.
        """
        carrier = self._carrier()
        if carrier is None or not carrier.slots:
            raise RequestError("the board has no slots", "the board file declares them; see `captain run --board`")
        ask = text(question, "ask", {"list": 0, "on": 0, "off": 0, "cycle": 0})
        slots = carrier.slots
        if ask == "list":
            found = {name: str(carrier.look(name) or "") for name in slots}  # devices in slots without an interface too
            return {"slots": {name: slot | {"device": found[name]} for name, slot in carrier.listed().items()}}
        name = text(question, "slot", dict.fromkeys([*slots, *map(str, range(1, len(slots) + 1))]))
        slot = slots[name] if name in slots else list(slots.values())[int(name) - 1]
        slot.operate(ask)
        return {"slots": {slot.name: carrier.listed()[slot.name]}}

    def board(self, question: Question) -> dict[str, object]:
        """Answer {"do": "board"}: return the status of the board and the time line of the start."""
        carrier = self._carrier()
        return {"board": carrier.status() if carrier else None, "timeline": self._timeline.status()}

    def selftest(self, question: Question, answer: Answer) -> None:
        """Answer {"do": "selftest", "within_s": 30} with the capabilities, once all work or the time is over."""
        from firmware.station.selftest import Selftest  # imported on demand, because it loads the code of the board

        Selftest(self._loop, self._carrier(), self._interfaces, self._own_position, self._clock, answer).start()

    def operate(self, question: Question, answer: Answer) -> None:
        """Pass {"do": "operate", "interface": NAME, "ask": WORD, "arguments": {}} to the driver of that interface.

        Raises RequestError if the interface is unknown, if arguments is not an object, or if the driver has no commands
        or does not run.
        """
        name, ask = text(question, "interface", self._interfaces), text(question, "ask")
        arguments: Any = question.get("arguments", {})
        if not isinstance(arguments, dict):
            raise RequestError(f"arguments: {arguments!r} is not an object", 'give {"name": value}')
        one = self._interfaces[name]
        driver = one.interface.driver
        if not isinstance(driver, Operated):
            others = [
                other for other, entry in self._interfaces.items() if isinstance(entry.interface.driver, Operated)
            ]
            hint = f"one of {', '.join(others)}" if others else "no interface of this station accepts commands"
            raise RequestError(f"interface {name} ({one.interface.driver_name}) accepts no commands", hint)
        if not one.is_running:
            raise RequestError(f"interface {name} is {one.state}: {one.interface.why}", "see `captain status`")
        driver.operate(ask, arguments, answer)
