"""Running modem: its AT port, its Life and its reports, from start to stop."""

import logging
from collections.abc import Callable

from board.runtime.errors import InterfaceError, ProtocolError, StationError
from board.runtime.journal import Journal, Rate
from drivers.contract import Host
from drivers.sim8202g.bearer import AT_INTERFACE, AT_INTERFACES, BEARERS
from drivers.sim8202g.composition import Composition
from drivers.sim8202g.known import Known
from drivers.sim8202g.life import Life, ResetAskedError
from drivers.sim8202g.options import ModemOptions
from drivers.sim8202g.port import Above, AtPort
from drivers.sim8202g.questions import Questions
from drivers.sim8202g.recovery import Ladder
from drivers.sim8202g.script import Ended, Program, Run, Runner, StepError
from drivers.sim8202g.step import words
from drivers.sim8202g.steps import Steps
from drivers.sim8202g.system import System
from drivers.sim8202g.watch import COLDEST_C, HOTTEST_C, Watch
from drivers.wire.at import port
from drivers.wire.at.answers import registration, system_mode
from drivers.wire.at.forms import Command
from drivers.wire.redact import redact, redact_garbage

LEAVE_S = 10.0  # time limit of a program that ends a bearer
GARBAGE = Rate(1, 600.0)  # limit of journal lines about garbage, which a port may send for hours

log = logging.getLogger("captain.modem")


class ModemHistory:
    """State of a modem that survives a stop of its driver. A modem that resets itself leaves USB: the driver restarts.

    leaving  running programs that end a bearer.
    garbled  journal of garbage; kept, so that its rate limit also holds for a driver that is restarted often.
    is_hot   True if the journal's last line about temperature said that the modem is too hot or too cold.
    """

    def __init__(self, options: ModemOptions) -> None:
        self.known = Known()
        self.ladder = Ladder()
        self.composition = Composition(options.bearer)
        self.leaving: list[Program] = []
        self.garbled: Journal | None = None
        self.is_hot = False


class RunningModem:
    """State between start and stop of the driver; call open(), start() and stop() once each, in this order.

    port  AT port; None while it is closed.
    why   reason in words why the link is not up.
    """

    def __init__(self, options: ModemOptions, system: System, host: Host, history: ModemHistory) -> None:
        known = history.known
        known.clock = host.loop.clock
        self.host = host
        self.port: AtPort | None = None
        self.why = ""
        self._options = options
        self._system = system
        self._history = history
        self._known = known
        self._bearer = BEARERS[options.bearer](options, system)
        self._returns = self._is_running = False
        questions = Questions(known)
        steps = Steps(self, options, known, questions, self._bearer, history.composition)
        watch = Watch(questions, known, self._bearer, system, host.loop.clock, options.poll_s)
        self._life = Life(host, self, known, steps, self._bearer, watch, history.ladder)
        self._runner = Runner(host.loop, self, self._life.run(), host.fail)
        for program in history.leaving:
            program.stop()
        history.leaving.clear()

    def start(self) -> None:
        """Start the script of the modem's Life."""
        self._known.forget_network()
        self._is_running = True
        self._runner.start()

    def stop(self) -> None:
        """Stop the script, start programs that end the bearer, and close the port; idempotent."""
        was_running, self._is_running = self._is_running, False
        if was_running:
            self._runner.stop()
        self._life.stop()
        self._system.stop_kept()
        if self.port is not None and was_running:
            self._leave_bearer()
        self.close()
        self._known.stop()
        self.report()

    def report(self) -> None:
        """Report the known state to the host."""
        self.host.report_details(self._known.details())

    def reset(self) -> None:
        """Reset the modem for an operator, if its Life runs."""
        if self._is_running:
            self._runner.interrupt(ResetAskedError("an operator wants it"))

    def _leave_bearer(self) -> None:
        """Start programs that end the bearer, without waiting; the next start ends the rest."""
        for argv in self._bearer.leave():
            try:
                self._history.leaving.append(self._system.run(self.host.loop, Run(argv, LEAVE_S), _nobody, _nobody))
            except StationError as error:
                log.debug("%s: %s", self.host.name, error.message)

    # -- drivers.sim8202g.steps.Ground, drivers.sim8202g.life.LifeHost

    @property
    def is_open(self) -> bool:
        return self.port is not None

    def open(self) -> None:
        options = self._options
        path = options.port
        if options.usb:
            number = AT_INTERFACES.get(self._system.product(options.usb), AT_INTERFACE)
            path = self._system.at_port(options.usb, number)
        above = Above(self._unsolicited, self._garbage, self._broken)
        self.port = AtPort(self.host.loop, path, above)
        self._returns = False

    def close(self) -> None:
        if self.port is not None:
            self.port.close()
            self.port = None

    def expect_return(self) -> None:
        self._returns = True

    def starting(self, why: str) -> None:
        self.why = redact(why)
        self.report()
        self.host.starting(self.why)

    def lost(self, why: str) -> None:
        self.why = redact(why)
        self.report()
        self.host.link(False, self.why)

    def looked(self) -> None:
        known = self._known
        known.device = self._bearer.device
        self.report()
        where = f"{known.device} has " if known.device else ""
        self.host.link(True, f"{where}{', '.join(known.addresses)}")
        self._look_at_temperature(known.temperature_c)

    def _look_at_temperature(self, celsius: int | None) -> None:
        """Log once that the modem is too hot or too cold, and once that its temperature is normal again."""
        is_hot = celsius is not None and not COLDEST_C <= celsius <= HOTTEST_C
        if celsius is not None and is_hot is not self._history.is_hot:
            self._history.is_hot = is_hot
            level = logging.WARNING if is_hot else logging.INFO
            log.log(level, "%s: %d C; it is made for %d to %d C", self.host.name, celsius, COLDEST_C, HOTTEST_C)

    # -- drivers.sim8202g.script.World

    def ask(self, command: Command, done: Callable[[port.Answer], None]) -> None:
        """Send a command to the AT port. Raises StepError if it is closed."""
        if self.port is None:
            raise StepError("the AT port is closed")
        self.port.ask(command, done)

    def run(self, run: Run, done: Callable[[Ended | StationError], None]) -> Program:
        log.debug("%s: %s", self.host.name, redact(" ".join(run.argv)))
        return self._system.run(self.host.loop, run, done, self._wake)

    def begun(self, step: str) -> None:
        self._known.step = step
        if step not in ("up", "blocked", "recovery"):  # for these steps, Life reports more detailed texts
            self.starting(words(step))

    def _wake(self) -> None:
        if self._is_running:
            self._runner.wake()

    # -- callbacks of the port

    def _unsolicited(self, line: str) -> None:
        log.debug("%s: %s", self.host.name, redact(line))
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

    def _garbage(self, garbage: port.Garbage) -> None:
        self._known.garbage += garbage.octets
        history = self._history
        history.garbled = history.garbled or Journal(log, self.host.name, self.host.loop.clock, GARBAGE)
        text = f"{self._known.garbage} octets at an AT port were not a valid line: {redact_garbage(garbage.sample)!r}"
        history.garbled.say(logging.WARNING, text)

    def _broken(self, error: InterfaceError) -> None:
        self.port = None
        if self._returns:
            self._wake()
        else:
            self.host.fail(error)


def _nobody(*_: object) -> None:
    """Ignore the result of a program that is not waited for."""
