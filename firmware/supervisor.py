"""Starts interfaces, and starts them again when they fail: soon at first, then less and less often, but for ever.

A try opens a socket or a device and harms nothing, and what is missing comes back without an operator: a network, a
cable, a port that another program had. The fault does not hide meanwhile: status shows it, the journal has it once.
Power is not touched here. That is for slots alone (slots.py), whose fault stays until an operator or a hot-plug event
clears it: the slot of an interface says when it is started, and may take it out of the tries.
"""

import logging
import random
from collections.abc import Callable

from board.errors import StationError
from board.loop import Loop, Timer
from drivers.reason import Reason
from firmware.interface import Interface

FIRST_S = 0.25
MOST_S = 5.0  # a person who plugs a cable back in looks no longer
JITTER = 0.2  # of the delay, so that what failed together does not return together

log = logging.getLogger("captain.supervisor")


class Supervised:
    """One interface's life: starting, up or down (its link), waiting for the next try, stopped.

    on_start    told that its driver runs.
    on_failure  asked, when it has failed, whether to try again: else somebody will call start().
    """

    def __init__(self, loop: Loop, interface: Interface, chance: Callable[[], float] = random.random) -> None:
        self.interface = interface
        self.restarts = 0
        self._loop = loop
        self._chance = chance
        self._delay = FIRST_S
        self._timer: Timer | None = None
        self._state = "stopped"
        self._said = ""
        self.hint = ""  # what to do about its last failure, until it is up again
        self.on_start: Callable[[], None] = lambda: None
        self.on_failure: Callable[[StationError], bool] = lambda error: True
        interface.on_fail = self._failed

    @property
    def state(self) -> str:
        """starting, up, down, waiting or stopped."""
        if self._state == "running":
            return "up" if self.interface.is_up else "down"
        return self._state

    def start(self) -> None:
        self._cancel()
        self._state = "starting"
        try:
            self.interface.driver.start(self.interface)
        except StationError as error:
            if self._state == "starting":  # else it has failed before it raised, and a retry is on its way
                self._retry(error)
            return
        if self._state == "starting":
            self._state = "running"
            self.hint = ""
            self._timer = self._loop.after(MOST_S, self._forgive)
            self.on_start()

    def hold(self, why: str) -> None:
        """Stop the driver, and start it no more until start() is called; idempotent."""
        self._cancel()
        if self._state in ("starting", "running"):
            self._stop_driver()
            self.interface.outlet.drop_kept(Reason.SEND_FAILED)
        self._state = "waiting"
        self._delay = FIRST_S
        self.interface.link(False, why)

    def stop(self) -> None:
        """Idempotent; of one that never started nothing is said."""
        self._cancel()
        if self._state == "stopped":
            return
        self._state = "stopped"
        self._stop_driver()
        self.interface.link(False, "stopped")

    def refresh(self) -> None:
        """Bring the interface's counters up to date."""
        if self._state == "running":
            self.interface.driver.refresh()

    def status(self) -> dict[str, object]:
        return {"state": self.state, "restarts": self.restarts, "hint": self.hint, **self.interface.status()}

    def _failed(self, error: StationError) -> None:
        if self._state not in ("starting", "running"):
            return
        self._stop_driver()
        self.interface.outlet.drop_kept(Reason.SEND_FAILED)
        self._retry(error)

    def _stop_driver(self) -> None:
        """What it has told of its module is of a moment that is over: a fix would stay, and its age with it."""
        self.interface.driver.stop()
        self.interface.tell({})

    def _retry(self, error: StationError) -> None:
        self._cancel()
        self._state = "waiting"
        self.restarts += 1
        self.hint = error.hint
        self.interface.link(False, error.message)
        # The same fault is said once, however often it is met.
        if str(error) != self._said:
            self._said = str(error)
            log.warning("%s: %s; trying again, at most every %.0f s", self.interface.name, error, MOST_S)
        if self.on_failure(error):
            delay = self._delay * (1.0 + JITTER * (2.0 * self._chance() - 1.0))
            self._delay = min(MOST_S, 2.0 * self._delay)
            self._timer = self._loop.after(delay, self.start)

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _forgive(self) -> None:
        """It has run for as long as the longest delay: its next fault is a new one."""
        self._delay = FIRST_S
        self._said = ""
