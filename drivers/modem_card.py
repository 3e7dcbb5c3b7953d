"""The SIM of a modem: waited for while it is busy, given its PIN, and what blocks where it takes somebody's hands."""

from collections.abc import Callable

from board.errors import BlockedError, ProtocolError
from drivers.modem_known import Known
from drivers.modem_options import ModemOptions
from drivers.modem_pin import PinError, PinGuard, read_pin
from drivers.modem_questions import Questions, one
from drivers.modem_script import NoAnswerError, Pause, Script, StepError, ask, refusal
from drivers.modem_step import words
from drivers.wire.at_forms import TIMEOUT
from drivers.wire.modem_answers import PIN_REFUSED, Sim, attempts, iccid, sim, sim_error

REMEDIES = {
    Sim.PUK: ("SIM: it asks for its PUK", "enter PUK and a new PIN in a telephone"),
    Sim.ABSENT: ("SIM: there is none", "is it in its holder, the right way round?"),
    Sim.LOCKED: ("SIM: locked to another device or network", "use the card that belongs to it"),
}


class Card:
    """The scripts of the step `sim`. say: why it is not done yet."""

    def __init__(
        self, options: ModemOptions, known: Known, questions: Questions, guard: PinGuard, say: Callable[[str], None]
    ) -> None:
        self._options = options
        self._known = known
        self._questions = questions
        self._guard = guard
        self._say = say

    def ready(self) -> Script[None]:
        """Return when the card is ready. Raises BlockedError where somebody has to do something."""
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
            found = Sim.BUSY  # asked again
        self._known.sim = found
        return found

    def _enter_pin(self) -> Script[None]:
        if not self._options.pin_file:
            raise BlockedError("SIM: it asks for a PIN", "name a file with it as pin_file")
        pin = read_pin(self._options.pin_file)
        card = yield from self._identity()
        left = yield from self._attempts()
        self._guard.begin(pin, card, left)
        answer = yield from ask(f'AT+CPIN="{pin}"')
        if answer.final.is_ok:
            self._guard.accepted(card)
            return
        if answer.final is TIMEOUT:  # nobody knows: the attempts that are left will tell
            raise StepError("SIM: no answer to the PIN")
        if sim_error(answer.final.code, answer.final.detail) in PIN_REFUSED or (yield from self._attempts()) < left:
            self._guard.refused(card)
            raise BlockedError("SIM: it refused the PIN", "correct pin_file; the same PIN is not tried again")
        self._say(words("sim", refusal("AT+CPIN", answer.final).message))
        yield Pause(2.0, wakes=True)  # it was busy: the PIN has not been looked at

    def _identity(self) -> Script[str]:
        """The card's own number, which a locked one says as well."""
        try:
            return (yield from self._questions.read("AT+CICCID", lambda found: iccid(one(found))))
        except NoAnswerError:
            raise
        except StepError as error:
            raise PinError(f"SIM: which it is cannot be read, so its PIN is not tried: {error.message}") from error

    def _attempts(self) -> Script[int]:
        left = yield from self._questions.read("AT+SPIC", lambda found: attempts(one(found)))
        self._known.pin_attempts = left.pin
        return left.pin
