"""Where pulses come in: its source, started again when it fails, and said once what it fails for."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Literal

from board.description import LineDescription, PulseDescription
from board.errors import InterfaceError
from board.loop import Loop, Timer
from pps.pulse import Above, Clocks, Pulse, Pulses

# A device appears when its overlay is loaded, and a line is free when another program has ended: nobody waits for less.
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
    """What a board file names: a PPS device, of which the rising edge is `assert` unless its overlay says otherwise,
    or a GPIO line.
    """
    if pulse.device:
        from pps.device import Device

        edge: Literal["assert", "clear"] = "assert" if pulse.edge == "rising" else "clear"
        return Device(loop, Path(pulse.device), above, edge=edge, clocks=clocks)
    from pps.edges import Edges

    line = LineDescription(chip=pulse.chip, offset=pulse.offset, line=pulse.line)
    return Edges(loop, line, above, kind=pulse.edge, dev=dev, clocks=clocks)


class PulseInput:
    """pps.pulse.Above for one source.

    make  makes the source for who is told of pulses, touching nothing.
    tell  is given each pulse.
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
        """Open it, now and again until it is open."""
        try:
            self._source.start()
        except InterfaceError as error:
            self._retry(error)
            return
        self._is_open, self._error = True, None
        if self._said:
            log.info("%s: pulses are taken", self._source.where)

    def stop(self) -> None:
        """Idempotent."""
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
        """The tally of the source counts them."""

    def failed(self, error: InterfaceError) -> None:
        self._is_open = False
        self._retry(error)

    @property
    def is_open(self) -> bool:
        return self._is_open

    def status(self) -> dict[str, object]:
        """Whether it is open and why not, and what has come: pulses, those that were missed, those too many."""
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
