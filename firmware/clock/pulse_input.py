"""Pulse input: opens the source of pulses, and retries after failures."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from board.description import LineDescription, PulseDescription
from board.runtime.errors import InterfaceError
from board.runtime.loop import Loop, Timer
from pps.pulse import Above, Clocks, Pulse, Pulses

# Retry interval in seconds: it starts at FIRST_S and doubles up to MOST_S. A device appears once its overlay is loaded,
# and a line becomes free when another program ends.
FIRST_S = 1.0
MOST_S = 30.0

log = logging.getLogger("captain.time")


def source(
    loop: Loop,
    pulse: PulseDescription,
    dev: Path,
    above: Above,
    clocks: Callable[[], Clocks],
) -> Pulses:
    """Return the source of pulses that a board file names: a PPS device or a GPIO line.

    pulse  table [pulse] of the board file.
    dev    folder of device files.
    above  receives the pulses.

    The rising edge of a PPS device is its event `assert`, unless the device-tree overlay inverts it.
    """
    if pulse.device:
        from pps.device import PulseDevice

        edge: Literal["assert", "clear"] = "assert" if pulse.edge == "rising" else "clear"
        return PulseDevice(loop, Path(pulse.device), above, edge=edge, clocks=clocks)
    from pps.edges import Edges

    line = LineDescription(chip=pulse.chip, offset=pulse.offset, line=pulse.line)
    return Edges(loop, line, above, kind=pulse.edge, dev=dev, clocks=clocks)


class PulseInput:
    """Pulse input: opens a source of pulses, retries after failures, and passes the pulses on.

    make  returns the source for a listener (pps.pulse.Above); it does not open the source.
    tell  receives each pulse.
    """

    def __init__(self, loop: Loop, make: Callable[[Above], Pulses], tell: Callable[[Pulse], None]) -> None:
        self._loop = loop
        self._tell = tell
        self._source = make(self)
        self._timer: Timer | None = None
        self._delay = FIRST_S
        self._is_open = False
        self._error: InterfaceError | None = None
        self._said = ""
        self._pulse_at: float | None = None
        self._failures = 0

    def start(self) -> None:
        """Open the source; if this fails, retry until it is open."""
        try:
            self._source.start()
        except InterfaceError as error:
            self._retry(error)
            return
        self._is_open, self._error = True, None
        if self._said:
            log.info("%s: input for pulses open", self._source.where)

    def stop(self) -> None:
        """Close the source; a second call has no effect."""
        if self._timer is not None:
            self._timer.cancel()
        self._is_open = False
        self._source.stop()

    # pps.pulse.Above

    def pulse(self, pulse: Pulse) -> None:
        self._pulse_at = pulse.monotonic
        self._delay, self._said = FIRST_S, ""
        self._tell(pulse)

    def missed(self, count: int) -> None:
        """Ignore missed pulses, because the source counts them."""

    def failed(self, error: InterfaceError) -> None:
        self._is_open = False
        self._retry(error)

    @property
    def is_open(self) -> bool:
        return self._is_open

    def status(self) -> dict[str, object]:
        """Return the state of the input and the counts of pulses.

        input     device or GPIO line.
        is_open   true while the input is open.
        why       error if the input is not open; else empty.
        hint      remedy if the input is not open; else empty.
        failures  number of errors.
        age_s     seconds since the last pulse; null before the first one.
        taken     number of received pulses.
        missed    number of seconds without a pulse.
        extra     number of surplus pulses.
        """
        tally, error = self._source.tally, self._error
        age_s = None if self._pulse_at is None else round(self._loop.clock() - self._pulse_at, 3)
        return {
            "input": self._source.where,
            "is_open": self._is_open,
            "why": error.message if error else "",
            "hint": error.hint if error else "",
            "failures": self._failures,
            "age_s": age_s,
            "taken": tally.taken,
            "missed": tally.missed,
            "extra": tally.extra,
        }

    def _retry(self, error: InterfaceError) -> None:
        self._failures += 1
        self._error = error
        if str(error) != self._said:
            self._said = str(error)
            log.warning("no pulses: %s; trying again, at most every %.0f s", error, MOST_S)
        self._timer = self._loop.after(self._delay, self.start)
        self._delay = min(MOST_S, 2 * self._delay)
