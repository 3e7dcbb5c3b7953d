"""What an operator may ask of a running station over its control socket, beside its status."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from board.errors import RequestError
from board.loop import Loop
from drivers.contract import Answer, Operated
from firmware.place import Place
from firmware.question import Command, Later, Question, text
from firmware.supervisor import Supervised
from firmware.timeline import Timeline

if TYPE_CHECKING:
    from firmware.carrier import Carrier


class Operator:
    """The questions `operate`, `slot`, `board` and `selftest`.

    interfaces  by name.
    carrier     gives what has brought up the board; None where there is nothing to.
    clock       gives the status of the time.
    """

    def __init__(
        self,
        loop: Loop,
        interfaces: Mapping[str, Supervised],
        carrier: Callable[[], "Carrier | None"],
        place: Place,
        clock: Callable[[], Mapping[str, Any]],
        timeline: Timeline,
    ) -> None:
        self._loop = loop
        self._place = place
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
        """{"do": "slot", "ask": "list"}, or "on", "off" or "cycle" with "slot": its name, or its number from 1 on."""
        carrier = self._carrier()
        if carrier is None or not carrier.slots:
            raise RequestError("the board has no slots", "the board file declares them; see `captain run --board`")
        ask = text(question, "ask", {"list": 0, "on": 0, "off": 0, "cycle": 0})
        slots = carrier.slots
        if ask == "list":
            found = {name: str(carrier.look(name) or "") for name in slots}  # also in a slot that nobody uses
            return {"slots": {name: slot | {"device": found[name]} for name, slot in carrier.listed().items()}}
        name = text(question, "slot", dict.fromkeys([*slots, *map(str, range(1, len(slots) + 1))]))
        slot = slots[name] if name in slots else list(slots.values())[int(name) - 1]
        slot.operate(ask)
        return {"slots": {slot.name: carrier.listed()[slot.name]}}

    def board(self, question: Question) -> dict[str, object]:
        """{"do": "board"}: all that is known of the board, and the time line of the start."""
        carrier = self._carrier()
        return {"board": carrier.status() if carrier else None, "timeline": self._timeline.status()}

    def selftest(self, question: Question, answer: Answer) -> None:
        """{"do": "selftest", "within_s": 30}: each capability, once all have come up."""
        from firmware.selftest import Selftest  # with all that a board needs

        Selftest(self._loop, self._carrier(), self._interfaces, self._place, self._clock, answer).start()

    def operate(self, question: Question, answer: Answer) -> None:
        """{"do": "operate", "interface": NAME, "ask": WORD, "arguments": {}} goes to that interface's driver."""
        name, ask = text(question, "interface", self._interfaces), text(question, "ask")
        arguments: Any = question.get("arguments", {})
        if not isinstance(arguments, dict):
            raise RequestError(f"arguments: {arguments!r} is no object", 'give {"name": value}')
        one = self._interfaces[name]
        driver = one.interface.driver
        if not isinstance(driver, Operated):
            others = [
                other for other, entry in self._interfaces.items() if isinstance(entry.interface.driver, Operated)
            ]
            hint = f"one of {', '.join(others)}" if others else "no interface of this station can"
            raise RequestError(f"interface {name} ({one.interface.driver_name}) cannot be asked anything", hint)
        if one.state not in ("up", "down"):
            raise RequestError(f"interface {name} is {one.state}: {one.interface.why}", "see `captain status`")
        driver.operate(ask, arguments, answer)
