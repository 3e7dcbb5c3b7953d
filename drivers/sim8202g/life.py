"""Life of a modem: bring-up, watch and recovery, as one script.

State table:

# state                 meaning                            event                        -> state
#
# port ... bearer       bring-up steps of steps.py         each done within its limit      up
# up                    watch.py checks every poll_s       an error                        by its class, below
# blocked               a person must act                  BLOCKED_S, or a line about      identity, sim or bearer if it
#                                                          card or network                 was blocked, else sim
# recovery              pause before the next action       the pause expires               the action, then its step
#                                                          after a loss: network is back   attach
#
# BlockedError                     -> blocked: no card, a locked card, a refused PIN, a missing program; no action helps
# ResetAskedError, by an operator  -> recovery without a pause, by a reset
# LostError after FLAP_S of up     -> sim: the network ended the connection, the modem works
# an error of the step port        -> StuckError, which ends this script: only a power cycle helps a silent port
# an error of registration         -> recovery by the next action against a loss: never by power, see recovery.py
# any other                        -> recovery by the next action against a fault, finally StuckError

The recovery actions are, in this order: register, radio, reset, power (recovery.Rung).

RunningModem (running.py) creates one Life for each start of the driver. Only the Runner (script.py) resumes it, on the
loop. RunningModem may interrupt it at any point by Runner.interrupt(), and ends it by Runner.stop() and stop(). An
error during recovery is handled in the same way: a refused action leads to the next one.

The Ladder selects the next action. It belongs to ModemHistory, which survives a Life. Otherwise a modem that resets
itself, and so leaves USB and restarts the driver, would get the first action each time. The Ladder starts again with
the first action after STEADY_S of up, and after a request for a power cycle.

A bearer that was up for less than FLAP_S counts as faulty, not lost: it gets the actions against a fault, with pauses.
"""

import logging
from typing import Protocol

from board.runtime.errors import BlockedError, StationError, StuckError
from board.runtime.loop import Timer
from drivers.contract import Host
from drivers.sim8202g.bearer import Bearer
from drivers.sim8202g.known import Known
from drivers.sim8202g.recovery import STEADY_S, Ladder, Rung, climb
from drivers.sim8202g.script import Begin, LostError, Pause, Script
from drivers.sim8202g.steps import Steps
from drivers.sim8202g.watch import Watch
from drivers.wire.redact import redact

BLOCKED_S = 30.0  # interval of the checks if the cause of a block is removed
FLAP_S = 60.0  # a bearer that was up for less than this time counts as faulty, not lost

POWER_HINT = "cut its power: captain slot cycle"

log = logging.getLogger("captain.modem")


class ResetAskedError(StationError):
    """An operator requested a reset."""


class LifeHost(Protocol):
    """Driver as its Life sees it.

    is_open  True if the AT port is open.
    lost     takes the link down, with a reason.
    looked   reports the state after a successful check.
    """

    @property
    def is_open(self) -> bool: ...
    def lost(self, why: str) -> None: ...
    def looked(self) -> None: ...


class Life:
    """Script of a modem's life, which only a StuckError ends."""

    def __init__(
        self,
        host: Host,
        above: LifeHost,
        known: Known,
        steps: Steps,
        bearer: Bearer,
        watch: Watch,
        ladder: Ladder,
    ) -> None:
        self._name = host.name
        self._loop = host.loop
        self._above = above
        self._known = known
        self._steps = steps
        self._bearer = bearer
        self._watch = watch
        self._ladder = ladder
        self._steady: Timer | None = None
        self._up_since: float | None = None

    def stop(self) -> None:
        """Cancel the timer that resets the Ladder."""
        if self._steady is not None:
            self._steady.cancel()

    def run(self) -> Script[None]:
        """Bring the modem up, watch it, and handle each error, including errors during recovery.

        Raises StuckError if only a power cycle can help.
        """
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
        """Handle an error by its class; return the step at which bring-up continues. Raises StuckError."""
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
        """Wait until an operator may have removed the cause of the block; return the step to try again."""
        yield Begin("blocked", None)
        yield from self._leave_bearer(f"{error.message}; {error.hint}" if error.hint else error.message)
        yield Pause(BLOCKED_S, wakes=True)
        return step if step in ("identity", "sim", "bearer") else "sim"

    def _use(self, error: StationError, rung: Rung, pause: float, is_loss: bool) -> Script[str]:
        """Execute a recovery action after a pause in seconds; return the step at which bring-up continues."""
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
        """Wait up to a time in seconds; return True as soon as the modem is registered, False at the end."""
        end = self._loop.clock() + seconds
        while (left := end - self._loop.clock()) > 0:
            if (yield from self._steps.questions.ask_registration()):
                return True
            yield Pause(min(10.0, max(1.0, left)), wakes=True)
        return False

    def _leave_bearer(self, why: str) -> Script[None]:
        self._known.addresses = ()
        self._above.lost(why)
        if not self._above.is_open:
            return
        try:
            yield from self._bearer.down()
        except StationError as error:
            log.debug("%s: %s", self._name, redact(error.message))
