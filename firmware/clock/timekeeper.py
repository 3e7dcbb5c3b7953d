"""Timekeeper: publishes time quality once a second, from the best source."""

import logging
import time
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

from board.description import PulseDescription
from board.runtime.loop import Loop
from board.time.scales import Fix, Lock, TimeMark, TimeQuality
from firmware.clock import receivers
from firmware.clock.own_time import OwnTime
from firmware.config.tables import TimeOptions
from firmware.endpoint.control.question import Question
from firmware.station.simulation import Simulation

if TYPE_CHECKING:
    from firmware.clock.pulsed_time import PulsedTime
    from firmware.clock.system_clock import SystemClock
    from pps.pulse import Above, Clocks, Pulses

PERIOD_S = 1.0
# Satellites repeat the number of leap seconds every 12.5 minutes (IS-GPS-200). Until then, no warning is needed.
LEAPS_S = 900.0
FRESH_S = 1.5  # age above which a quality is renewed before use: the loop or the machine has paused

# Largest change of the offset in a second that counts as slewing. chronyd slews the system clock by at most 83,333 ppm.
# The next second is expected to have the same change. A larger change was a step, which predicts nothing.
MOST_SLEWED_NS = 100_000_000

# Error in ns below which the system clock counts as better than the time from a receiver's messages. Receivers report
# no bound for the delay of their messages, and a message is sometimes later than this.
GOOD_NS = 100_000_000

log = logging.getLogger("captain.time")


class Timekeeper:
    """Timekeeper of a station. Without pulses and receiver, it uses the system clock.

    options     table [time] of captain.toml.
    pulse       table [pulse] of the board file; None without one.
    own         ITS time of the station, which uses the estimate from pulses if there is one.
    tell        receives the quality of each second, at its beginning.
    simulation  provides the pulses of a simulated board.
    clocks      reads the clocks of the machine; None: the real ones.
    """

    def __init__(
        self,
        loop: Loop,
        options: TimeOptions,
        pulse: PulseDescription | None,
        own: OwnTime,
        tell: Callable[[TimeQuality], None],
        simulation: Simulation,
        clocks: "Callable[[], Clocks] | None" = None,
    ) -> None:
        self.quality = TimeQuality()
        self._loop = loop
        self._options = options
        self._pulse = pulse
        self._own = own
        self._tell = tell
        self._simulation = simulation
        self._clocks = clocks
        self._announcing: Collection[str] = ()
        self._receiver = ""
        self._pulsed: PulsedTime | None = None
        self._system: SystemClock | None = None
        self._offset_ns: int | None = None  # value of the previous second
        self._is_running = False
        self._doubt = ""  # state of the leap-second table
        self._told_at = loop.clock()

    def start(self, announcing: Collection[str]) -> None:
        """Open the inputs in the next turn of the loop, so that they do not delay the first message.

        announcing  interfaces whose receivers announce pulses.
        """
        self._announcing = announcing
        self._receiver = receivers.chosen(self._options, self._pulse, announcing)
        self._is_running = True
        self._loop.soon(self._open)

    def stop(self) -> None:
        """Close the inputs; a second call has no effect."""
        self._is_running = False
        pulsed, self._pulsed = self._pulsed, None  # from now on, reports of drivers are ignored
        if pulsed is not None:
            pulsed.stop()
        if self._system is not None:
            self._system.stop()

    def fix(self, source: str, fix: Fix) -> None:
        if self._pulsed is not None and source == self._receiver:
            self._pulsed.fix(fix)

    def time_mark(self, source: str, mark: TimeMark) -> None:
        if self._pulsed is not None and source == self._receiver:
            self._pulsed.mark(mark)

    def status(self) -> dict[str, object]:
        """Return the part of the status about time.

        monotonic  CLOCK_MONOTONIC in seconds at which the quality was determined.
        state      source of the time: `unknown`, `system`, `coarse`, `settling`, `locked` or `holdover`.
        error_ns   largest error of the system clock in ns, in 99.9 % of cases; null if unknown.
        its_ms     own ITS time in ms; null if unknown.
        leap       leap seconds; null until the table was read.
        tracking   answer of `chronyc tracking`; null if chronyd is not asked.
        missing    remedy for a more accurate time, such as a missing input; empty if none is known.
        """
        if self._loop.clock() > self._told_at + FRESH_S:
            self.renew()
        quality = self.quality
        told = {key: value for key, value in quality._asdict().items() if key not in ("state", "leap", "source")}
        its_ms = self._own.its_ms(self._loop.clock())
        parts = self._pulsed.status() if self._pulsed else {"receiver": "", "pulse": None, "refclock": None}
        return {
            "monotonic": self._told_at,
            "state": quality.state.name.lower(),
            **told,
            "error_ns": quality.error_ns,
            "its_ms": its_ms,
            "leap": self._leap_status(its_ms),
            **parts,
            "tracking": self._system.status() if self._system else None,
            "missing": self._missing(),
        }

    def told(self, question: Question) -> dict[str, object]:
        """Answer {"do": "time"} with the status of the time and a short history of the last hour.

        With "history": true, the answer has the whole history (format: TimeHistory.told).
        """
        told: dict[str, object] = {}
        if self._pulsed is not None:
            kept = self._pulsed.history
            told = kept.told() if question.get("history") is True else kept.brief()
        return {"clock": self.status(), "history": told}

    def _open(self) -> None:
        if not self._is_running:
            return
        from board.time.leaps import known
        from firmware.clock.system_clock import SystemClock

        options = self._options
        self._own.leaps = leaps = known(options.leap_list, time.time())
        self._doubt = leaps.doubt
        self._loop.after(LEAPS_S if self._receiver else 0.0, self._warn_of_leaps)
        if self._receiver:
            self._pulsed = self._made(self._receiver)
            self._own.estimator = self._pulsed
            self._pulsed.start()
        is_asked = options.tracking or (options.tracking is None and bool(options.chrony))
        self._system = SystemClock(self._loop, is_asked, self._own.is_system_set)
        self._system.start()
        self._loop.after(PERIOD_S, self._second)

    def _made(self, receiver: str) -> "PulsedTime":
        from firmware.clock.pulse_input import source
        from firmware.clock.pulsed_time import PulsedTime
        from pps.pulse import read_clocks

        pulse, clocks = self._pulse, self._clocks or read_clocks

        def made(above: "Above") -> "Pulses":
            assert pulse is not None
            if pulse.kind:
                return self._simulation.pulses(above, clocks)
            return source(self._loop, pulse, self._simulation.machine.dev, above, clocks)

        latency_ns = pulse.latency_ns if pulse else 0
        chrony = self._options.chrony
        return PulsedTime(self._loop, receiver, made if pulse else None, latency_ns, chrony, self._own, clocks)

    def _warn_of_leaps(self) -> None:
        """Log that the leap-second table may be wrong, unless the receiver has replaced it."""
        if self._is_running and self._doubt and not self._is_leap_settled():
            log.warning("%s", self._doubt)

    def _second(self) -> None:
        if not self._is_running:
            return
        self._loop.after(PERIOD_S, self._second)
        self.renew()

    def renew(self) -> None:
        """Determine the current quality of the time and pass it to `tell`."""
        if not self._is_running or self._system is None:
            return
        quality = self._pulsed.quality(self._system.chronyds_ns()) if self._pulsed else TimeQuality()
        self.quality = self._of_the_second(self._system.quality() if quality.state is Lock.UNKNOWN else quality)
        self._own.is_system_good = self.quality.state is Lock.SYSTEM and (self.quality.error_ns or GOOD_NS) < GOOD_NS
        self._told_at = self._loop.clock()
        self._tell(self.quality)

    def _of_the_second(self, quality: TimeQuality) -> TimeQuality:
        """Return a quality that is valid for the next second.

        The offset may change in it as much as in the last second, so this change is added to the uncertainty.
        """
        before_ns, self._offset_ns = self._offset_ns, quality.offset_ns
        if before_ns is None or quality.offset_ns is None or quality.uncertainty_ns is None:
            return quality
        changed_ns = abs(quality.offset_ns - before_ns)
        if changed_ns > MOST_SLEWED_NS:
            return quality
        return quality._replace(uncertainty_ns=quality.uncertainty_ns + changed_ns)

    def _leap_status(self, its_ms: int | None) -> dict[str, object] | None:
        """Return the state of the leap-second table; None until it was read.

        table     source of the table: `receiver`, `built in`, or the path of the list.
        expires   Unix time at which the table expires; null if unknown.
        doubt     reason why the table may be wrong, in words; may be empty.
        seconds   number of leap seconds since 2004; null while the time is unknown.
        event     announced leap second; null if none is announced.
        event.utc  UTC time of the announced leap second.
        """
        leaps = self._own.leaps
        if leaps is None:
            return None
        event = None if its_ms is None else leaps.next(its_ms * 1_000_000)
        return {
            "table": leaps.source,
            "expires": leaps.expires,
            "doubt": "" if self._is_leap_settled() else leaps.doubt,
            "seconds": None if its_ms is None else leaps.leap_seconds(its_ms * 1_000_000),
            "event": event and {**event._asdict(), "utc": leaps.civil(event.its_s * 1_000_000_000)},
        }

    def _is_leap_settled(self) -> bool:
        """Whether the receiver has confirmed or replaced the leap-second table."""
        leaps = self._own.leaps
        return leaps is not None and leaps.base is not None and leaps.doubt == self._doubt

    def _missing(self) -> str:
        """Return the remedy for a more accurate time; empty with a pulse input, whose status has its own remedy."""
        if not self._receiver and len(self._announcing) > 1:
            names = " and ".join(self._announcing)
            return f"{names} announce pulses: captain.toml needs [time] with receiver, one of them"
        if not self._receiver:
            return 'no interface announces pulses: captain.toml needs one with driver = "zed_f9p" and pulse = true'
        if self._pulse is None:
            return "no input for pulses: the board file needs [pulse] with the device or line that they come to"
        return ""
