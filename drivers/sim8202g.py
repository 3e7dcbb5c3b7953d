"""SIMCom SIM8202G-M2, a 5G modem, as a bearer: it brings itself up, stays up, and says what is wrong.

It carries no PDUs itself: its link is up while there is a network to carry them. Nothing here touches power. What is
left to power is host.fail(StuckError).

| step | done when | at most |
|---|---|---|
| port | the tty is there and AT is answered | 90 s |
| identity | model and firmware are known, the USB composition is that of the bearer | 60 s |
| sim | the card is ready, its PIN given | 60 s |
| configuration | radio on, network mode and access point set | 90 s |
| registration | one of 5G, LTE, 3G is registered, at home or roaming | 180 s |
| attach | packets are allowed | 200 s |
| bearer | the network device has an address | 120 s |

A step that is not done in time is recovered from as modem_recovery.py says. A card that is absent or locked blocks:
the reason stays until somebody changes something, which is looked at every 30 s.
"""

import logging
from collections.abc import Callable, Mapping
from typing import ClassVar

from board.errors import InterfaceError, ProtocolError, RequestError, StationError
from board.journal import Journal, Rate
from drivers.contract import Answer, Can, Capabilities, Host, Sent, Shared
from drivers.message import Request
from drivers.modem_bearer import AT_INTERFACE, AT_INTERFACES, BEARERS
from drivers.modem_composition import Composition
from drivers.modem_known import Known
from drivers.modem_life import Life, ResetAskedError
from drivers.modem_operator import Operations
from drivers.modem_options import ModemOptions
from drivers.modem_port import Above, AtPort
from drivers.modem_questions import Questions
from drivers.modem_recovery import Ladder
from drivers.modem_script import Ended, Program, Run, Runner, StepError
from drivers.modem_step import words
from drivers.modem_steps import Steps
from drivers.modem_system import System
from drivers.modem_watch import COLDEST_C, HOTTEST_C, Watch
from drivers.wire import at
from drivers.wire.at_forms import Command
from drivers.wire.modem_answers import registration, system_mode
from drivers.wire.redact import redact, redact_garbage

LEAVE_S = 10.0  # that a program has which ends a bearer
GARBAGE = Rate(1, 600.0)  # lines of the journal about it: a port may be full of it for hours

log = logging.getLogger("captain.modem")


class Sim8202g:
    """The driver. system is the machine's programs and devices."""

    Options: ClassVar[type] = ModemOptions
    capabilities: ClassVar[Capabilities] = Capabilities(Can.BEARER, "5g", 0)

    def __init__(self, options: ModemOptions, shared: Shared, system: System | None = None) -> None:
        self._options = options
        self._system = system or System(shared.machine)
        self._known = Known()
        # Kept: a modem that resets itself leaves USB, and the supervisor may start this driver again for it.
        self._ladder = Ladder()
        self._composition = Composition(options.bearer)
        self._port: AtPort | None = None
        self._runner: Runner | None = None
        self._life: Life | None = None
        self._leaving: list[Program] = []
        self._returns = False
        self._garbled: Journal | None = None  # kept as well: a garbled port is started again and again
        self._is_hot = False
        self.why = ""

    # -- drivers.contract.Driver

    def start(self, host: Host) -> None:
        options, known = self._options, self._known
        self._host = host
        known.clock = host.loop.clock
        for program in self._leaving:
            program.stop()
        self._leaving.clear()
        self.open()
        known.forget_network()
        bearer = self._bearer = BEARERS[options.bearer](options, self._system)
        questions = Questions(known)
        steps = Steps(self, options, known, questions, bearer, self._composition)
        watch = Watch(questions, known, bearer, self._system, host.loop.clock, options.poll_s)
        self._life = Life(host.name, host.loop, self, known, steps, bearer, watch, self._ladder)
        self._runner = Runner(host.loop, self, self._life.run(), self._failed)
        self._runner.start()

    def send(self, request: Request) -> Sent:
        raise RequestError(f"{self._host.name} is a bearer, which sends no messages")

    def refresh(self) -> None:
        """Nothing is counted elsewhere; but what is known has become older."""
        self._host.tell(self._known.details())

    def stop(self) -> None:
        runner, self._runner = self._runner, None
        if runner is not None:
            runner.stop()
        if self._life is not None:
            self._life.stop()
        self._system.stop_kept()
        if self._port is not None and runner is not None:
            self._leave_bearer()
        self.close()
        self._known.stop()
        if self._life is not None:
            self._host.tell(self._known.details())

    def _leave_bearer(self) -> None:
        """Have programs end it; they are not waited for, and the next start ends what they did not."""
        for argv in self._bearer.leave():
            try:
                self._leaving.append(self._system.run(self._host.loop, Run(argv, LEAVE_S), _nobody, _nobody))
            except StationError as error:
                log.debug("%s: %s", self._host.name, error.message)

    # -- drivers.contract.Operated

    def operate(self, do: str, arguments: Mapping[str, object], answer: Answer) -> None:
        """`status`, `at` and `reset`, as modem_operator.py has them."""
        Operations(self._port, self._known, self._reset).operate(do, arguments, answer)

    def _reset(self) -> None:
        if self._runner is not None:
            self._runner.interrupt(ResetAskedError("an operator wants it"))

    # -- drivers.modem_steps.Ground, drivers.modem_life.Above

    @property
    def is_open(self) -> bool:
        return self._port is not None

    def open(self) -> None:
        options = self._options
        path = options.port
        if options.usb:
            number = AT_INTERFACES.get(self._system.product(options.usb), AT_INTERFACE)
            path = self._system.at_port(options.usb, number)
        above = Above(self._unsolicited, self._garbage, self._broken)
        self._port = AtPort(self._host.loop, path, above)
        self._returns = False

    def close(self) -> None:
        if self._port is not None:
            self._port.close()
            self._port = None

    def expect_return(self) -> None:
        self._returns = True

    def say(self, why: str) -> None:
        self.why = why = redact(why)
        self._host.tell(self._known.details())
        self._host.link(False, why)

    def looked(self) -> None:
        known = self._known
        known.device = self._bearer.device
        self._host.tell(known.details())
        where = f"{known.device} has " if known.device else ""
        self._host.link(True, f"{where}{', '.join(known.addresses)}")
        self._look_at_temperature(known.temperature_c)

    def _look_at_temperature(self, celsius: int | None) -> None:
        """Say once that it is too hot or too cold, and once that it is not any more."""
        is_hot = celsius is not None and not COLDEST_C <= celsius <= HOTTEST_C
        if celsius is not None and is_hot is not self._is_hot:
            self._is_hot = is_hot
            level = logging.WARNING if is_hot else logging.INFO
            log.log(level, "%s: %d C; it is made for %d to %d C", self._host.name, celsius, COLDEST_C, HOTTEST_C)

    # -- drivers.modem_script.World

    def ask(self, command: Command, done: Callable[[at.Answer], None]) -> None:
        if self._port is None:
            raise StepError("the AT port is closed")
        self._port.ask(command, done)

    def run(self, run: Run, done: Callable[[Ended | StationError], None]) -> Program:
        log.debug("%s: %s", self._host.name, redact(" ".join(run.argv)))
        return self._system.run(self._host.loop, run, done, self._wake)

    def begun(self, step: str) -> None:
        self._known.step = step
        if step not in ("up", "blocked", "recovery"):  # who begins one of these says more
            self.say(words(step))

    def _failed(self, error: StationError) -> None:
        self._host.fail(error)

    def _wake(self) -> None:
        if self._runner is not None:
            self._runner.wake()

    # -- what the port tells

    def _unsolicited(self, line: str) -> None:
        log.debug("%s: %s", self._host.name, redact(line))
        name = line.partition(":")[0]
        try:
            if name in ("+C5GREG", "+CEREG", "+CGREG"):
                found = registration(line)
                self._known.registrations[found.domain] = found
                self._known.read("registration")
                self._wake()
            elif name == "+CNSMOD":
                self._known.system_mode = system_mode(line)
            elif name in ("+CPIN", "+SIMCARD", "+CGEV"):
                self._wake()
        except ProtocolError:
            self._known.misread += 1

    def _garbage(self, garbage: at.Garbage) -> None:
        self._known.garbage += garbage.octets
        self._garbled = self._garbled or Journal(log, self._host.name, self._host.loop.clock, GARBAGE)
        sample = redact_garbage(garbage.sample)
        self._garbled.say(logging.WARNING, f"{self._known.garbage} octets have meant nothing at an AT port: {sample!r}")

    def _broken(self, error: InterfaceError) -> None:
        self._port = None
        if self._returns:
            self._wake()
        else:
            self._host.fail(error)


def _nobody(*_: object) -> None:
    """Who waits for a program that is not waited for."""
