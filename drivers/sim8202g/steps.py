"""Bring-up of a modem: one step after the other, each with a time limit.

port ─> identity ─> sim ─> configuration ─> registration ─> attach ─> bearer ─> up
  ^         │        ^                                                           │
  └─────────┘        └──────────────────── network, bearer or card lost ─────────┘
 other USB composition
"""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from board.runtime.errors import InterfaceError, ProtocolError
from drivers.sim8202g.bearer import Bearer
from drivers.sim8202g.card import Card
from drivers.sim8202g.composition import Composition
from drivers.sim8202g.known import Known
from drivers.sim8202g.options import IP_TYPES, NETWORK_MODES, ModemOptions
from drivers.sim8202g.pin import PinGuard
from drivers.sim8202g.questions import DOMAINS, Questions
from drivers.sim8202g.script import Begin, LostError, NoAnswerError, Pause, Script, ask, lines, refusal
from drivers.sim8202g.step import BRING_UP, words
from drivers.wire.at.answers import PacketContext, packet_contexts, usb_id
from drivers.wire.redact import redact

LEAVE_S = 30.0  # longest wait for the modem to leave USB after a command that makes it do so
ADDRESS_TRIES = 10  # look-ups of the address after the bearer has come up, one per second


class Ground(Protocol):
    """Modem as its Steps see it: they open and close its AT port, and report progress.

    is_open  True if the AT port is open.
    """

    @property
    def is_open(self) -> bool: ...
    def open(self) -> None:
        """Open the AT port. Raises InterfaceError if it cannot be opened."""

    def close(self) -> None: ...
    def expect_return(self) -> None:
        """Announce that the port will disappear and come back, which is then not a fault."""

    def starting(self, why: str) -> None:
        """Report in words what the bring-up does or waits for."""


class Steps:
    """Scripts of all bring-up steps.

    questions    questions to this modem.
    bearer       bearer that the options select.
    composition  USB composition that the bearer needs.
    """

    def __init__(
        self,
        ground: Ground,
        options: ModemOptions,
        known: Known,
        questions: Questions,
        bearer: Bearer,
        composition: Composition,
    ) -> None:
        self._ground = ground
        self.questions = questions
        self._options = options
        self._known = known
        self._bearer = bearer
        self._composition = composition
        guard = PinGuard(Path(options.state_dir) / f"{options.usb or Path(options.port).name}-pin.json")
        self._card = Card(options, known, questions, guard, ground.starting)
        self._scripts: dict[str, Callable[[], Script[None]]] = {
            "port": self._port,
            "identity": self._identity,
            "sim": self._card.ready,
            "configuration": self._configuration,
            "registration": self._registration,
            "attach": self._attach,
            "bearer": self._connect,
        }

    def bring_up(self, first: str) -> Script[None]:
        """Execute all steps from `first` on."""
        steps = list(BRING_UP)
        for step in steps[steps.index(first) :]:
            yield from self._step(step)

    def reenumerate(self, text: str) -> Script[None]:
        """Send a command after which the modem leaves USB and comes back; return when its port is closed.

        text  AT command.

        Raises StepError if the modem refuses the command.
        """
        self._ground.expect_return()
        answer = yield from ask(text)
        if self._ground.is_open and not answer.final.is_ok:
            raise refusal(text, answer.final)
        yield Begin("restart", None)
        if self._ground.is_open:
            yield Pause(LEAVE_S, wakes=True)
        self._ground.close()
        self._known.forget_network()

    # -- steps

    def _step(self, step: str) -> Script[None]:
        yield Begin(step, BRING_UP[step].limit_s)
        yield from self._scripts[step]()

    def _port(self) -> Script[None]:
        self.questions.forget()
        while not self._ground.is_open:
            try:
                self._ground.open()
            except InterfaceError as error:
                self._ground.starting(words("port", error.message))
                yield Pause(1.0)
        # While the modem boots, it sends nothing, or lines of its boot loader.
        while not (yield from self._is_awake()):
            self._ground.starting(words("port", "no answer to AT"))
            yield Pause(1.0)

    def _is_awake(self) -> Script[bool]:
        try:
            answers = (yield from ask("ATE0V1")), (yield from ask("AT+CMEE=1"))
        except NoAnswerError:
            return False
        return all(answer.final.is_ok for answer in answers)

    def _identity(self) -> Script[None]:
        known = self._known
        known.model = _plain((yield from lines("AT+CGMM")), "+CGMM")
        known.firmware = _plain((yield from lines("AT+CGMR")), "+CGMR")
        answer = yield from ask("AT+CUSBCFG?")
        try:
            vendor, product = usb_id(answer.lines)
        except ProtocolError:
            return  # this firmware lacks the command; the bearer reports a missing network device later
        # The modem was seen to fall back to another composition after a hard reset, so each bring-up checks it.
        known.composition = f"{vendor:04x}:{product:04x}"

        switch = self._composition.switch(vendor, product)
        if switch is not None:
            more = f"USB composition {known.composition} is not that of the bearer: {switch}"
            self._ground.starting(words("identity", more))
            yield from self.reenumerate(switch)
            yield from self._step("port")
            yield from self._step("identity")

    def _configuration(self) -> Script[None]:
        if (yield from self.questions.number("+CFUN")) != 1:
            yield from lines("AT+CFUN=1")
        mode = NETWORK_MODES.get(self._options.network_mode)
        if mode is not None and (yield from self.questions.number("+CNMP")) != mode:
            yield from lines(f"AT+CNMP={mode}")
        yield from self._context()
        for text in ("AT+CREG=0", *(f"AT+{domain}=2" for domain in DOMAINS), "AT+CNSMOD=1", "AT+CGEREP=2,1"):
            yield from ask(text)  # a refusal is ignored: without unsolicited lines, polling finds changes

    def _context(self) -> Script[None]:
        """Configure the packet context before the modem attaches: LTE sets the context up in the attach."""
        if not self._options.apn:
            return
        wanted = PacketContext(1, IP_TYPES[self._options.ip_type], self._options.apn)
        there = yield from self.questions.optional("AT+CGDCONT?", packet_contexts)
        if there is not None and wanted in there:
            return
        yield from lines(f'AT+CGDCONT=1,"{wanted.ip_type}","{wanted.apn}"')
        yield from ask("AT+CGATT=0")

    def _registration(self) -> Script[None]:
        while not (yield from self.questions.ask_registration()):
            self._ground.starting(words("registration", self._known.registration_text))
            yield from self.questions.look_at_cell()
            yield Pause(5.0, wakes=True)
            yield from self._card.ready()  # checks the card again, because it may have been taken out

    def _attach(self) -> Script[None]:
        if (yield from self.questions.number("+CGATT")) != 1:
            yield from lines("AT+CGATT=1")

    def _connect(self) -> Script[None]:
        while True:
            yield from self._bearer.up()
            for _ in range(ADDRESS_TRIES):
                try:
                    self._known.addresses = yield from self._bearer.look()
                except LostError:  # the bearer has no address yet
                    yield Pause(1.0)
                else:
                    return


def _plain(found: tuple[str, ...], prefix: str) -> str:
    """Return the last line of an answer without its prefix, such as the model; skip lines with identifiers."""
    words = [line.removeprefix(f"{prefix}:").strip() for line in found]
    return next((word for word in reversed(words) if redact(word) == word), "")[:40]
