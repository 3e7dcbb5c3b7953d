"""A GNSS receiver as an interface: where the station is, and which second a pulse begins. It carries no messages."""

import logging
from collections.abc import Callable, Mapping
from typing import ClassVar

from board.errors import InterfaceError, RequestError, StationError, StuckError
from board.journal import REPEATS, Journal
from board.loop import Timer
from board.machine import Machine
from board.time import Fix, TimeMark
from drivers.contract import Answer, Can, Capabilities, Host, Sent, Shared
from drivers.gnss_corrections import Corrections, corrections
from drivers.gnss_nmea import NmeaReceiver
from drivers.gnss_options import GnssOptions
from drivers.gnss_receiver import SILENT_S, Above, Receiver
from drivers.gnss_static import StaticReceiver
from drivers.gnss_ubx import UbxReceiver
from drivers.message import Request
from drivers.wire.gnss_fix import Jumps

log = logging.getLogger("captain.gnss")

LOOK_S = 1.0  # between two looks at whether epochs still come, and two reports of details
STUCK = 3  # failures in a row, after which only losing power may help

_KINDS: dict[str, Callable[[GnssOptions, Machine, Above], Receiver]] = {
    "ubx": UbxReceiver,
    "nmea": NmeaReceiver,
    "static": StaticReceiver,
}
_CAN = {"ubx": Can.POSITION | Can.TIMEMARK, "nmea": Can.POSITION, "static": Can.POSITION}

_FIXES = ("none", "dead reckoning", "2d", "3d", "combined", "time only")
_CARRIERS = ("none", "float", "fixed")


class ZedF9p:
    """A receiver with its corrections, and their supervision.

    The link is up while epochs come, whatever they say: no sky is not a broken cable. What the fix is worth is in
    each Fix, and in the details.
    """

    Options: ClassVar[type] = GnssOptions

    def __init__(self, options: GnssOptions, shared: Shared) -> None:
        self.capabilities = Capabilities(_CAN[options.kind], "gnss", 0)
        self._options = options
        self._receiver: Receiver = _KINDS[options.kind](options, shared.machine, self)
        self._corrections: Corrections | None = None
        self._timer: Timer | None = None
        self._failures = 0

    def start(self, host: Host) -> None:
        self.host = host
        self._fix = Fix(host.loop.clock())
        self._epoch_at = host.loop.clock()
        self._ready = ""  # what the link is up with when the first epoch comes
        self._jumps = Jumps()
        self._withheld = 0
        self._journal = Journal(log, host.name, host.loop.clock, REPEATS)
        self._timer = host.loop.after(LOOK_S, self._look)
        # First, for a receiver that fails while it starts stops all there is.
        self._corrections = corrections(self._options.corrections, host, self._receiver.correct)
        try:
            self._receiver.start()
        except InterfaceError:
            self.stop()
            raise

    def send(self, request: Request) -> Sent:
        raise RequestError(f"{self.host.name} is a GNSS receiver, which sends nothing")

    def refresh(self) -> None:
        """Nothing but the driver counts."""

    def stop(self) -> None:
        self._rest()
        self._receiver.stop()
        if self._corrections is not None:
            self._corrections.close()
            self._corrections = None

    def operate(self, do: str, arguments: Mapping[str, object], answer: Answer) -> None:
        """`status`: the details of now; `reset` with `kind`: hot, warm, cold or full."""
        try:
            answer(self._operate(do, arguments))
        except StationError as error:
            answer(error)

    # What the receiver tells: drivers.gnss_receiver.Above

    def configured(self, why: str) -> None:
        self._epoch_at = self.host.loop.clock()
        self._ready = why

    def epoch(self, fix: Fix) -> None:
        self._failures = 0
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
        self._failures += 1
        if self._failures >= STUCK and not isinstance(error, StuckError):
            error = StuckError(error.message, error.hint)
        self.host.fail(error)

    def _is_believed(self, fix: Fix) -> bool:
        before = self._jumps.count
        is_believed = self._jumps.is_believed(fix)
        if self._jumps.count > before:
            kilometres = self._jumps.metres / 1000
            self._journal.say(
                logging.WARNING,
                f"the position jumped by {kilometres:.1f} km; not passed on before {Jumps.CONFIRMED} epochs agree",
            )
        return is_believed

    def _rest(self) -> None:
        """Look no more: it was stopped, or will be because it failed."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _look(self) -> None:
        self._timer = self.host.loop.after(LOOK_S, self._look)
        silence = self.host.loop.clock() - self._epoch_at
        if silence >= SILENT_S:
            self._receiver.silent(silence)
        if self._timer is not None:  # it did not fail
            self.host.tell(self._details())

    def _details(self) -> dict[str, object]:
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
            **self._receiver.details(),
        }
        if self._corrections is not None:
            of_receiver = found.get("corrections")
            assert isinstance(of_receiver, dict)
            found["corrections"] = {**self._corrections.details(), **of_receiver}
        return found

    def _operate(self, do: str, arguments: Mapping[str, object]) -> dict[str, object]:
        if do == "status":
            return self._details()
        if do != "reset":
            raise RequestError(f"a receiver cannot {do!r}", "it can status and reset")
        kind = str(arguments.get("kind", "hot"))
        self._receiver.reset(kind)
        log.info("%s: %s reset, asked for by an operator", self.host.name, kind)
        return {"reset": kind}
