"""State of chronyd: output of `chronyc -c tracking`, read by a child process."""

import logging
from collections.abc import Sequence
from typing import NamedTuple

from board.runtime.errors import InterfaceError, ProtocolError
from board.runtime.journal import Journal
from board.runtime.loop import Loop, Timer
from board.runtime.tool import Tool

PERIOD_S = 10.0
LIMIT_S = 3.0  # chronyc itself gives up after 1 s + 2 s if chronyd hangs
# -n: look up no names. -c: numbers between commas. -m is not used, because there is a single command.
COMMAND = ("chronyc", "-n", "-c")

UNSYNCHRONISED = "Not synchronised"
LEAPS = ("Normal", "Insert second", "Delete second", UNSYNCHRONISED)
_FIELDS = 14
MAX_SHOWN = 60  # characters of an invalid answer in a message


class Tracking(NamedTuple):
    """State of chronyd, in the order and units of `chronyc -c tracking` (chronyc(1), "System clock").

    reference_id       8 hexadecimal digits; 50505300 is "PPS".
    reference          name or address of the reference.
    stratum            1 with a reference clock, 0 while not synchronised.
    updated_unix_s     Unix time when the reference was last heard.
    system_offset_s    true time minus the system's clock, as estimated by chronyd: positive if the clock is slow.
    last_offset_s      offset of the last update: positive if the clock was ahead of the reference.
    rms_offset_s       mean of such offsets.
    frequency_ppm      frequency error of the uncorrected clock: positive if it runs fast.
    residual_ppm       difference of the last samples from that.
    skew_ppm           error bound of frequency_ppm.
    root_delay_s       delay to the source of the time.
    root_dispersion_s  dispersion to the source of the time.
    update_interval_s  time between the last updates.
    leap               Normal, Insert second, Delete second, or Not synchronised.
    """

    reference_id: str
    reference: str
    stratum: int
    updated_unix_s: float
    system_offset_s: float
    last_offset_s: float
    rms_offset_s: float
    frequency_ppm: float
    residual_ppm: float
    skew_ppm: float
    root_delay_s: float
    root_dispersion_s: float
    update_interval_s: float
    leap: str

    @property
    def is_synchronised(self) -> bool:
        return self.leap != UNSYNCHRONISED

    @property
    def offset_ns(self) -> int | None:
        """True time minus the system's clock; None while chronyd is not synchronised."""
        return round(self.system_offset_s * 1e9) if self.is_synchronised else None

    @property
    def uncertainty_ns(self) -> int | None:
        """Bound of the error of the system's clock + offset_ns.

        Source: chronyc(1), "Root dispersion": clock_error <= |system_time_offset| + root_dispersion + root_delay / 2.
        """
        if not self.is_synchronised:
            return None
        return round((self.root_dispersion_s + self.root_delay_s / 2) * 1e9)


def tracking(text: str) -> Tracking:
    """Parse one line of `chronyc -c tracking`. Raises ProtocolError for any other text."""
    fields = text.strip().split(",")
    if len(fields) != _FIELDS:
        raise ProtocolError(f"unexpected output of chronyc: {_short(text)!r}: not {_FIELDS} fields")
    reference_id, reference, stratum, *numbers, leap = fields
    if leap not in LEAPS:
        raise ProtocolError(f"unexpected leap status of chronyc: {_short(leap)!r}")
    try:
        known = [_hexadecimal(reference_id), reference, int(stratum)]
        return Tracking._make([*known, *map(_finite, numbers), leap])
    except ValueError as error:
        raise ProtocolError(f"unexpected output of chronyc: {_short(text)!r}: {error}") from error


class Tracker:
    """Asks chronyd every PERIOD_S, by one child process at a time.

    command  chronyc with its options; `-h` selects a socket or address other than chronyc's default.
    latest   last answer; None after a failed query.
    """

    def __init__(self, loop: Loop, journal: Journal, command: Sequence[str] = COMMAND) -> None:
        self.latest: Tracking | None = None
        self.asked = self.answered = 0
        self.why = ""  # error of the last query; empty after an answer
        self._loop = loop
        self._journal = journal
        self._command = (*command, "tracking")
        self._tool: Tool | None = None
        self._timer: Timer | None = None

    @property
    def is_asking(self) -> bool:
        return self._tool is not None

    def start(self) -> None:
        """Ask now, then every PERIOD_S; without effect if started already."""
        if self._timer is None:
            self._ask()

    def stop(self) -> None:
        """Stop asking and forget the last answer; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._tool is not None:
            self._tool.leave()
            self._tool = None
        self.latest = None

    def _ask(self) -> None:
        self._timer = self._loop.after(PERIOD_S, self._ask)
        if self._tool is not None:
            return  # the previous chronyc exceeded LIMIT_S and is being ended
        self.asked += 1
        try:
            self._tool = Tool(self._loop, self._command, LIMIT_S, self._said, quick=True)
        except InterfaceError as error:
            self._fail(f"{error.message} ({error.hint})" if error.hint else error.message)

    def _said(self, status: int | None, text: str) -> None:
        self._tool = None
        if status:
            self._fail(f"status {status}: {_short(text)}")
            return
        try:
            self.latest = tracking(text)
        except ProtocolError as error:
            self._fail(error.message)
            return
        self.answered += 1
        if self.why:
            self._journal.say(logging.INFO, "chronyc answers again")
        self.why = ""

    def _fail(self, why: str) -> None:
        self.latest = None
        if why != self.why:
            self._journal.say(logging.WARNING, f"state of chronyd unknown: {why}")
        self.why = why


def _hexadecimal(text: str) -> str:
    int(text, 16)
    return text


def _finite(text: str) -> float:
    number = float(text)
    if not abs(number) < 1e18:
        raise ValueError(f"{text} is out of range")
    return number


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."
