"""Interface supervisor: starts a driver, and starts it again after each failure.

Rules:

# state      meaning                                event                    -> state
#
# stopped    before start(), after stop()           start()                     starting
# starting   the driver's start() runs              it returns                  running
#                                                   it raises, driver_failed()  waiting
# running    shown as starting, up or down, by the  driver_failed()             waiting
#            link
# waiting    the driver is stopped                  the back-off, if one runs,  starting
#                                                   is over; start()
# any        stop() -> stopped. hold() -> waiting, without a back-off, until start() is called

The station calls stop() of every interface, and start() of those without a slot. For an interface in a slot, the slot
supervisor (firmware/slots) calls start(), hold() and stop(). Its own driver_failed(), called at the failure, decides
whether a back-off runs. Host.fail() calls driver_failed() at any time, also from inside the driver's start() or send();
while stopped or waiting it does nothing.

Retries have no limit. A retry only opens a socket or a device, and networks, cables and ports may return without an
operator. Meanwhile the status shows the fault, and the log has it once. This module does not switch power: the slot
supervisor does. A fault of a slot stays until an operator or a hot-plug event clears it.

The back-off is reset when the driver has run for MOST_S, by a single timer that every transition cancels. An earlier
version had one timer per start. An old timer then reset the back-off of a later start, so an interface that failed
each second was started four times a second. If a driver calls fail() inside start() and then raises, it is retried
once, not twice. The details that a driver has reported are removed when it is stopped. Otherwise the status would still
show the last fix of a receiver in a slot without power.
"""

import logging
import random
from collections.abc import Callable
from typing import Protocol

from board.runtime.errors import StationError
from board.runtime.loop import Loop, Timer
from drivers.reason import Reason
from firmware.routing.interface import Interface

FIRST_S = 0.25
MOST_S = 5.0  # longest back-off in seconds: after a cable was plugged in, the link returns within this time
JITTER = 0.2  # random fraction of the back-off: interfaces that failed together then retry at different times

log = logging.getLogger("captain.supervisor")


class StartListener(Protocol):
    """Listener that is called after each start of a driver."""

    def driver_started(self) -> None: ...


class DriverSlot(StartListener, Protocol):
    """Slot of a driver's module, which decides on retries (firmware.slots.supervisor.SlotSupervisor)."""

    def driver_failed(self, error: StationError) -> bool:
        """Return True to restart the driver after the back-off; False if the slot will call start() itself."""


class InterfaceSupervisor:
    """Supervisor of one interface's driver: starts it, and restarts it after failures.

    chance    returns random numbers from 0 to 1, for the jitter of the back-off.
    slot      slot of the interface's module; None if it has none.
    follower  listener that reports the bearer's link to the driver; None if the driver uses no bearer.
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
        self.hint = ""  # remedy for the last failure, until the driver starts successfully
        self.slot: DriverSlot | None = None
        self.follower: StartListener | None = None
        interface.supervisor = self

    @property
    def state(self) -> str:
        """State for the status: starting, up, down, waiting (for the next retry) or stopped."""
        if self._state == "running":
            return self.interface.link_state
        return self._state

    @property
    def is_running(self) -> bool:
        """True while the driver is started, in any state of its link."""
        return self._state == "running"

    def start(self) -> None:
        self._cancel()
        self._state = "starting"
        self.interface.begin()
        try:
            self.interface.driver.start(self.interface)
        except StationError as error:
            if self._state == "starting":  # else the driver has called fail(), which scheduled a retry
                self._retry(error)
            return
        if self._state == "starting":
            self._state = "running"
            self.hint = ""
            self._timer = self._loop.after(MOST_S, self._clear_back_off)
            for listener in (self.slot, self.follower):
                if listener is not None:
                    listener.driver_started()

    def hold(self, why: str) -> None:
        """Stop the driver without a retry until start() is called; a second call has no effect."""
        self._cancel()
        if self._state in ("starting", "running"):
            self._stop_driver()
            self.interface.outlet.drop_kept(Reason.SEND_FAILED)
        self._state = "waiting"
        self._delay = FIRST_S
        self.interface.link(False, why)

    def stop(self) -> None:
        """Stop the driver. For a stopped interface this does nothing and logs nothing."""
        self._cancel()
        if self._state == "stopped":
            return
        self._state = "stopped"
        self._stop_driver()
        self.interface.link(False, "stopped")

    def refresh(self) -> None:
        """Make the driver update those counters of the interface that the kernel keeps."""
        if self._state == "running":
            self.interface.driver.refresh()

    def status(self) -> dict[str, object]:
        """Return the interface's part of the status.

        state     `starting` (until the link is up or a fault is known), `up`, `down`, `waiting` (for the next try) or
                  `stopped`.
        restarts  number of failures after which the driver was or will be restarted.
        hint      remedy for the last failure; empty if unknown or if the driver runs again.
        """
        return {"state": self.state, "restarts": self.restarts, "hint": self.hint, **self.interface.status()}

    def driver_failed(self, error: StationError) -> None:
        """Stop the driver after a failure, and restart it after the back-off. Ignored while it is not started."""
        if self._state not in ("starting", "running"):
            return
        self._stop_driver()
        self.interface.outlet.drop_kept(Reason.SEND_FAILED)
        self._retry(error)

    def _stop_driver(self) -> None:
        """Stop the driver and remove its details: the status would otherwise still show a fix with its last age."""
        self.interface.driver.stop()
        self.interface.report_details({})

    def _retry(self, error: StationError) -> None:
        self._cancel()
        self._state = "waiting"
        self.restarts += 1
        self.hint = error.hint
        self.interface.link(False, error.message)
        # The same fault is logged only once, although it is repeated at each retry.
        if str(error) != self._said:
            self._said = str(error)
            log.warning("%s: %s; trying again, at most every %.0f s", self.interface.name, error, MOST_S)
        if self.slot is None or self.slot.driver_failed(error):
            delay = self._delay * (1.0 + JITTER * (2.0 * self._chance() - 1.0))
            self._delay = min(MOST_S, 2.0 * self._delay)
            self._timer = self._loop.after(delay, self.start)

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _clear_back_off(self) -> None:
        """Reset the back-off, because the driver has run for MOST_S. Even the same fault is then logged again."""
        self._delay = FIRST_S
        self._said = ""
