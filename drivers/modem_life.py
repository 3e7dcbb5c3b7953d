"""What a modem does for as long as its interface runs: up, watched, down, and up again."""

import logging
from typing import Protocol

from board.errors import BlockedError, StationError, StuckError
from board.loop import Loop, Timer
from drivers.modem_bearer import Bearer
from drivers.modem_known import Known
from drivers.modem_recovery import STEADY_S, Ladder, Rung, climb
from drivers.modem_script import Begin, LostError, Pause, Script
from drivers.modem_steps import Steps
from drivers.modem_watch import Watch
from drivers.wire.redact import redact

BLOCKED_S = 30.0  # between two looks at what blocks
FLAP_S = 60.0  # a bearer that was up for less is not lost, but faulty

POWER_HINT = "cut its power: captain slot cycle"

log = logging.getLogger("captain.modem")


class ResetAskedError(StationError):
    """An operator wants a reset."""


class Above(Protocol):
    """What a life needs of its driver. is_open: whether the AT port is."""

    @property
    def is_open(self) -> bool: ...
    def say(self, why: str) -> None: ...
    def looked(self) -> None: ...


class Life:
    """The script; what ends it is a StuckError."""

    def __init__(
        self,
        name: str,
        loop: Loop,
        above: Above,
        known: Known,
        steps: Steps,
        bearer: Bearer,
        watch: Watch,
        ladder: Ladder,
    ) -> None:
        self._name = name
        self._loop = loop
        self._above = above
        self._known = known
        self._steps = steps
        self._bearer = bearer
        self._watch = watch
        self._ladder = ladder
        self._steady: Timer | None = None
        self._up_since: float | None = None

    def stop(self) -> None:
        """Forget the timer."""
        if self._steady is not None:
            self._steady.cancel()

    def run(self) -> Script[None]:
        """Bring up and watch, and answer to each error, those of an answer included."""
        first, error = "port", None
        while True:
            try:
                if error is None:
                    yield from self._steps.bring_up(first)
                    yield from self._stay_up()
                else:
                    first = yield from self._answer_to(error)
                    error = None
            except StuckError:
                raise
            except StationError as found:
                error = found

    def _stay_up(self) -> Script[None]:
        yield Begin("up", None)
        self._up_since = self._loop.clock()
        self._steady = self._loop.after(STEADY_S, self._ladder.steady)
        yield from self._watch.run(self._above.looked)

    def _answer_to(self, error: StationError) -> Script[str]:
        """Do what an error asks for; returns the step to go on with."""
        step, up_since = self._known.step, self._up_since
        self.stop()
        self._up_since = None
        if isinstance(error, BlockedError):
            return (yield from self._blocked(error, step))
        if isinstance(error, ResetAskedError):
            return (yield from self._use(error, Rung.RESET, 0.0, is_loss=False))
        if isinstance(error, LostError) and up_since is not None and self._loop.clock() - up_since >= FLAP_S:
            yield from self._leave_bearer(error.message)
            return "sim"
        if step == "port":
            self._ladder.steady()
            raise StuckError(redact(error.message), POWER_HINT)
        is_loss = step == "registration"
        rung, pause = self._ladder.loss() if is_loss else self._ladder.fault()
        if rung is Rung.POWER:
            self._ladder.steady()
            raise StuckError(f"{redact(error.message)}; resets did not help", POWER_HINT)
        return (yield from self._use(error, rung, pause, is_loss))

    def _blocked(self, error: BlockedError, step: str) -> Script[str]:
        """Wait until somebody may have changed something."""
        yield Begin("blocked", None)
        yield from self._leave_bearer(f"{error.message}; {error.hint}" if error.hint else error.message)
        yield Pause(BLOCKED_S, wakes=True)
        return step if step in ("identity", "sim", "bearer") else "sim"

    def _use(self, error: StationError, rung: Rung, pause: float, is_loss: bool) -> Script[str]:
        """Use a means after a pause."""
        yield Begin("recovery", None)
        log.warning("%s: %s; next, in %.0f s: %s", self._name, redact(error.message), pause, rung.value)
        yield from self._leave_bearer(f"{error.message}; next: {rung.value}")
        if not is_loss:
            yield Pause(pause)
        elif (yield from self._network_returns(pause)):
            return "attach"
        self._known.recoveries += 1
        return (yield from climb(rung, self._steps))

    def _network_returns(self, seconds: float) -> Script[bool]:
        """Wait; whether the network has come by itself in that time."""
        end = self._loop.clock() + seconds
        while (left := end - self._loop.clock()) > 0:
            if (yield from self._steps.questions.ask_registration()):
                return True
            yield Pause(min(10.0, max(1.0, left)), wakes=True)
        return False

    def _leave_bearer(self, why: str) -> Script[None]:
        self._known.addresses = ()
        self._above.say(why)
        if not self._above.is_open:
            return
        try:
            yield from self._bearer.down()
        except StationError as error:
            log.debug("%s: %s", self._name, redact(error.message))
