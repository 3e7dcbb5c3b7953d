"""Questions to a modem whose answers may be late, garbled, or not known to its firmware; Known keeps what they say."""

from collections.abc import Callable
from typing import TypeVar

from board.errors import ProtocolError
from drivers.modem_known import Known
from drivers.modem_script import Script, StepError, ask, refusal
from drivers.wire.at_forms import TIMEOUT
from drivers.wire.cell import Access, cell_report
from drivers.wire.modem_answers import flag, operator, registration, signal_dbm, system_mode, temperature_c
from drivers.wire.redact import redact

T = TypeVar("T")

Parser = Callable[[tuple[str, ...]], T]

TRIES = 3  # of a question whose answer was garbled or late

DOMAINS = ("C5GREG", "CEREG", "CGREG")


class Questions:
    """Asks, and keeps what was answered."""

    def __init__(self, known: Known) -> None:
        self._known = known
        self._unknown: set[str] = set()  # commands that this firmware does not have
        self._understood: set[str] = set()  # those that it has answered: an ERROR is of the moment

    def forget(self) -> None:
        """Another modem may be at the port, or other firmware."""
        self._unknown.clear()
        self._understood.clear()

    def read(self, text: str, parse: Parser[T]) -> Script[T]:
        """A question whose answer may be garbled or late once. Raises StepError."""
        last = StepError(f"{text}: no answer")
        for _ in range(TRIES):
            answer = yield from ask(text)
            if answer.final is TIMEOUT:
                continue
            if not answer.final.is_ok:
                raise refusal(text, answer.final)
            try:
                return parse(answer.lines)
            except ProtocolError as error:
                self._known.misread += 1
                last = StepError(redact(f"{text}: {error.message}"))
        raise last

    def number(self, name: str) -> Script[int]:
        """The number that a question such as `+CFUN` is answered with. Raises StepError."""
        return self.read(f"AT{name}?", lambda found: flag(one(found), name))

    def optional(self, text: str, parse: Parser[T]) -> Script[T | None]:
        """The same, None where this firmware has no such command, or gives it no answer now."""
        if text in self._unknown:
            return None
        answer = yield from ask(text)
        if answer.final.is_ok:
            self._understood.add(text)
        elif answer.final.name in ("ERROR", "COMMAND NOT SUPPORT") and text not in self._understood:
            self._unknown.add(text)
        if not answer.final.is_ok:
            return None
        try:
            return parse(answer.lines)
        except ProtocolError:
            self._known.misread += 1
            return None

    def ask_registration(self) -> Script[bool]:
        """Ask every domain; whether one is registered. Of one that does not answer nothing is known any more."""
        for domain in DOMAINS:
            found = yield from self.optional(f"AT+{domain}?", lambda found: registration(one(found)))
            if found is None:
                self._known.registrations.pop(domain, None)
            else:
                self._known.registrations[domain] = found
        if self._known.registrations:
            self._known.read("registration")
        else:  # every modem has one of them: it was not able to say so
            self._unknown.difference_update(f"AT+{domain}?" for domain in DOMAINS)
        return self._known.is_registered

    def look_at_cell(self) -> Script[None]:
        """Cell and signal."""
        known = self._known
        known.cell = yield from self.optional("AT+CPSI?", cell_report)
        known.read("cell")
        if known.cell is None or known.cell.access is not Access.SA:
            known.rssi_dbm = yield from self.optional("AT+CSQ", lambda found: signal_dbm(one(found)))

    def look_at_module(self) -> Script[None]:
        """Temperature and operator, which change slowly."""
        known = self._known
        known.temperature_c = yield from self.optional("AT+CPMUTEMP", lambda found: temperature_c(one(found)))
        known.read("module")
        known.operator = (yield from self.optional("AT+COPS?", lambda found: operator(one(found)))) or ""
        known.system_mode = (yield from self.optional("AT+CNSMOD?", lambda found: system_mode(one(found)))) or ""


def one(found: tuple[str, ...]) -> str:
    """The one line of an answer. Raises ProtocolError where there is none."""
    if not found:
        raise ProtocolError("OK without an answer")
    return found[-1]
