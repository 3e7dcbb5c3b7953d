"""SIM of a modem: waits while it is busy, enters its PIN, blocks for an operator."""

from collections.abc import Callable

from board.runtime.errors import BlockedError, ProtocolError
from drivers.sim8202g.known import Known
from drivers.sim8202g.options import ModemOptions
from drivers.sim8202g.pin import PinError, PinGuard, read_pin
from drivers.sim8202g.questions import Questions, one
from drivers.sim8202g.script import NoAnswerError, Pause, Script, StepError, ask, refusal
from drivers.sim8202g.step import words
from drivers.wire.at.answers import PIN_REFUSED, Sim, attempts, iccid, sim, sim_error
from drivers.wire.at.forms import TIMEOUT

REMEDIES = {
    Sim.PUK: ("SIM: locked, and needs its PUK", "enter PUK and a new PIN in a telephone"),
    Sim.ABSENT: ("SIM: absent", "insert the SIM into its holder in the right direction"),
    Sim.LOCKED: ("SIM: locked to another device or network", "use a SIM that this modem accepts"),
}


class Card:
    """Scripts of the bring-up step `sim`.

    say  called with the reason why the step is not done yet.
    """

    def __init__(
        self, options: ModemOptions, known: Known, questions: Questions, guard: PinGuard, say: Callable[[str], None]
    ) -> None:
        self._options = options
        self._known = known
        self._questions = questions
        self._guard = guard
        self._say = say

    def ready(self) -> Script[None]:
        """Return when the card is ready.

        Raises BlockedError if a person must act: insert a card, or correct or provide the PIN. Raises StepError if
        the modem does not answer the PIN.
        """
        while (state := (yield from self._state())) is not Sim.READY:
            self._say(words("sim", state.value))
            if state in REMEDIES:
                raise BlockedError(*REMEDIES[state])
            if state is Sim.PIN:
                yield from self._enter_pin()
            else:
                yield Pause(2.0, wakes=True)

    def _state(self) -> Script[Sim]:
        answer = yield from ask("AT+CPIN?")
        try:
            found = sim(one(answer.lines)) if answer.final.is_ok else sim_error(answer.final.code, answer.final.detail)
        except ProtocolError:
            found = Sim.BUSY  # an invalid answer counts as busy, so the question is repeated
        self._known.sim = found
        return found

    def _enter_pin(self) -> Script[None]:
        if not self._options.pin_file:
            raise BlockedError("SIM: it needs its PIN", "set pin_file to a file that contains the PIN")
        pin = read_pin(self._options.pin_file)
        card = yield from self._identity()
        left = yield from self._attempts()
        self._guard.begin(pin, card, left)
        answer = yield from ask(f'AT+CPIN="{pin}"')
        if answer.final.is_ok:
            self._guard.accepted(card)
            return
        if answer.final is TIMEOUT:  # result unknown: at the next try the attempts left show if the PIN was refused
            raise StepError("SIM: no answer to the PIN")
        if sim_error(answer.final.code, answer.final.detail) in PIN_REFUSED or (yield from self._attempts()) < left:
            self._guard.refused(card)
            raise BlockedError("SIM: it refused the PIN", "correct pin_file; the same PIN is not tried again")
        self._say(words("sim", refusal("AT+CPIN", answer.final).message))
        yield Pause(2.0, wakes=True)  # the card was busy and has not checked the PIN

    def _identity(self) -> Script[str]:
        """Return the card's ICCID, which can also be read while the card waits for its PIN."""
        try:
            return (yield from self._questions.read("AT+CICCID", lambda found: iccid(one(found))))
        except NoAnswerError:
            raise
        except StepError as error:
            raise PinError(f"SIM: its ICCID cannot be read, so its PIN is not tried: {error.message}") from error

    def _attempts(self) -> Script[int]:
        left = yield from self._questions.read("AT+SPIC", lambda found: attempts(one(found)))
        self._known.pin_attempts = left.pin
        return left.pin
