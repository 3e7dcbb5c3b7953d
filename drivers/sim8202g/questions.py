"""Questions to a modem by AT commands; stores the answers in Known.

Answers may be late or garbled, and some firmware does not know some commands.
"""

from collections.abc import Callable
from typing import TypeVar

from board.runtime.errors import ProtocolError
from drivers.sim8202g.known import Known
from drivers.sim8202g.script import Script, StepError, ask, refusal
from drivers.wire.at.answers import flag, operator, registration, signal_dbm, system_mode, temperature_c
from drivers.wire.at.forms import TIMEOUT
from drivers.wire.cell import Access, cell_report
from drivers.wire.redact import redact

T = TypeVar("T")

Parser = Callable[[tuple[str, ...]], T]

TRIES = 3  # most times that a question is sent while its answers are garbled or late

DOMAINS = ("C5GREG", "CEREG", "CGREG")


class Questions:
    """Sends AT questions to a modem, and stores the answers in Known."""

    def __init__(self, known: Known) -> None:
        self._known = known
        self._unknown: set[str] = set()  # commands that this firmware does not have
        self._understood: set[str] = set()  # commands that it has answered, so a later ERROR is temporary

    def forget(self) -> None:
        """Forget which commands the firmware knows, because another modem or firmware may be at the port now."""
        self._unknown.clear()
        self._understood.clear()

    def read(self, text: str, parse: Parser[T]) -> Script[T]:
        """Ask a question, again if its answer is garbled or late; return the parsed answer.

        text   AT command.
        parse  parser of the answer's lines; raises ProtocolError for a garbled answer.

        Raises StepError if the modem refuses the command, or if all TRIES answers are garbled or late.
        """
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
        """Return the number in the answer to a question such as `+CFUN`. Raises StepError as read() does."""
        return self.read(f"AT{name}?", lambda found: flag(one(found), name))

    def optional(self, text: str, parse: Parser[T]) -> Script[T | None]:
        """Ask once; return the parsed answer. None if the firmware lacks the command, or gives no valid answer now."""
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
        """Ask for the registration in every domain; return True if the modem is registered.

        A domain without a valid answer is removed from Known.
        """
        for domain in DOMAINS:
            found = yield from self.optional(f"AT+{domain}?", lambda found: registration(one(found)))
            if found is None:
                self._known.registrations.pop(domain, None)
            else:
                self._known.registrations[domain] = found
        if self._known.registrations:
            self._known.read("registration")
        else:  # every modem supports one of these commands, so their failure is temporary: ask all again next time
            self._unknown.difference_update(f"AT+{domain}?" for domain in DOMAINS)
        return self._known.is_registered

    def look_at_cell(self) -> Script[None]:
        """Ask for cell and signal strength."""
        known = self._known
        known.cell = yield from self.optional("AT+CPSI?", cell_report)
        known.read("cell")
        if known.cell is None or known.cell.access is not Access.SA:
            known.rssi_dbm = yield from self.optional("AT+CSQ", lambda found: signal_dbm(one(found)))

    def look_at_module(self) -> Script[None]:
        """Ask for temperature and operator, which change slowly."""
        known = self._known
        known.temperature_c = yield from self.optional("AT+CPMUTEMP", lambda found: temperature_c(one(found)))
        known.read("module")
        known.operator = (yield from self.optional("AT+COPS?", lambda found: operator(one(found)))) or ""
        known.system_mode = (yield from self.optional("AT+CNSMOD?", lambda found: system_mode(one(found)))) or ""


def one(found: tuple[str, ...]) -> str:
    """Return the last line of an answer. Raises ProtocolError if it has no line."""
    if not found:
        raise ProtocolError("OK without an answer")
    return found[-1]
