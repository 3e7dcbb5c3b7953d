"""Running receiver: supervises a receiver and its corrections, from start to stop."""

import logging
from collections.abc import Callable

from board.machine import Machine
from board.runtime.errors import InterfaceError, StuckError
from board.runtime.journal import REPEATS, Journal
from board.runtime.loop import Timer
from board.time.scales import Fix, TimeMark
from drivers.contract import Host
from drivers.gnss.corrections.source import Corrections, corrections
from drivers.gnss.nmea import NmeaReceiver
from drivers.gnss.options import GnssOptions
from drivers.gnss.receiver import SILENT_S, Receiver, ReceiverHost
from drivers.gnss.static import StaticReceiver
from drivers.gnss.ublox import UbxReceiver
from drivers.wire.gnss.fix import Jumps

log = logging.getLogger("captain.gnss")

LOOK_S = 1.0  # interval of the checks for missing epochs, and of the reports of details
STUCK = 3  # failures in a row after which a power cycle of the receiver is requested

_KINDS: dict[str, Callable[[GnssOptions, Machine, ReceiverHost], Receiver]] = {
    "ubx": UbxReceiver,
    "nmea": NmeaReceiver,
    "static": StaticReceiver,
}

_FIXES = ("none", "dead reckoning", "2d", "3d", "combined", "time only")
_CARRIERS = ("none", "float", "fixed")


class Failures:
    """Counter of failures since the last epoch, over all starts of an interface."""

    def __init__(self) -> None:
        self.count = 0

    def add(self, error: InterfaceError) -> InterfaceError:
        """Count a failure and return its error; from the STUCK-th on a StuckError, which requests a power cycle."""
        self.count += 1
        if self.count >= STUCK and not isinstance(error, StuckError):
            return StuckError(error.message, error.hint)
        return error


class RunningReceiver:
    """State between start() and stop(); after stop(), only details() is called. Implements ReceiverHost."""

    def __init__(self, options: GnssOptions, machine: Machine, host: Host, failures: Failures) -> None:
        now = host.loop.clock()
        self.host = host
        self._options = options
        self._failures = failures
        self._fix = Fix(now)
        self._epoch_at = now
        self._ready = ""  # text with which the first epoch takes the link up; empty afterwards
        self._jumps = Jumps()
        self._withheld = 0
        self._journal = Journal(log, host.name, host.loop.clock, REPEATS)
        self._corrections: Corrections | None = None
        self._timer: Timer | None = None
        self.receiver = _KINDS[options.kind](options, machine, self)

    def start(self) -> None:
        """Open the receiver and its corrections. Raises InterfaceError if that fails; both are then closed."""
        self._timer = self.host.loop.after(LOOK_S, self._look)
        # Corrections are opened first: a receiver may fail inside start(), which stops everything opened so far.
        self._corrections = corrections(self._options.corrections, self.host, self.receiver.correct)
        try:
            self.receiver.start()
        except InterfaceError:
            self.stop()
            raise

    def stop(self) -> None:
        """Close the receiver and its corrections; idempotent."""
        self._rest()
        self.receiver.stop()
        if self._corrections is not None:
            self._corrections.close()
            self._corrections = None

    def details(self) -> dict[str, object]:
        """Return details of the fix, the receiver and its corrections for status."""
        fix = self._fix
        found: dict[str, object] = {
            "receiver": self._options.kind,
            "fix": _FIXES[fix.kind],
            "carrier": _CARRIERS[fix.carrier],
            "satellites": fix.satellites,
            "horizontal_mm": fix.horizontal,
            "vertical_mm": fix.vertical,
            "age_s": round(self.host.loop.clock() - fix.monotonic, 3),
            "jumps": self._jumps.count,
            "withheld": self._withheld,
            **self.receiver.details(),
        }
        if self._corrections is not None:
            of_receiver = found.get("corrections")
            assert isinstance(of_receiver, dict)
            found["corrections"] = {**self._corrections.details(), **of_receiver}
        return found

    # Reports of the receiver: drivers.gnss.receiver.ReceiverHost

    def configured(self, why: str) -> None:
        self._epoch_at = self.host.loop.clock()
        self._ready = why

    def epoch(self, fix: Fix) -> None:
        self._failures.count = 0
        self._epoch_at = fix.monotonic
        if self._ready:
            self.host.link(True, self._ready)
            self._ready = ""
        if fix.latitude is not None and not self._is_believed(fix):
            self._withheld += 1
            return
        self._fix = fix
        self.host.fix(fix)

    def time_mark(self, mark: TimeMark) -> None:
        self.host.time_mark(mark)

    def failed(self, error: InterfaceError) -> None:
        self._rest()
        self.host.fail(self._failures.add(error))

    def _is_believed(self, fix: Fix) -> bool:
        before = self._jumps.count
        is_believed = self._jumps.is_believed(fix)
        if self._jumps.count > before:
            kilometres = self._jumps.metres / 1000
            self._journal.say(
                logging.WARNING,
                f"the position jumped by {kilometres:.1f} km; ignored until {Jumps.CONFIRMED} epochs agree on it",
            )
        return is_believed

    def _rest(self) -> None:
        """Stop the checks, because the receiver was stopped, or has failed and will be stopped."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _look(self) -> None:
        self._timer = self.host.loop.after(LOOK_S, self._look)
        silence = self.host.loop.clock() - self._epoch_at
        if silence >= SILENT_S:
            self.receiver.silent(silence)
        if self._timer is not None:  # a timer means that silent() has not called failed() or stop()
            self.host.report_details(self.details())
