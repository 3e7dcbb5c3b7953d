"""What time it is and how well that is known: the best word there is, told once a second to all who need it."""

import logging
import time
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

from board.description import PulseDescription
from board.loop import Loop
from board.time import Fix, Lock, TimeMark, TimeQuality
from firmware import receivers
from firmware.own_time import OwnTime
from firmware.question import Question
from firmware.simulation import Simulation
from firmware.tables import TimeOptions

if TYPE_CHECKING:
    from firmware.pulsed_time import PulsedTime
    from firmware.system_clock import SystemClock
    from pps.pulse import Above, Clocks, Pulses

PERIOD_S = 1.0
FRESH_S = 1.5  # a quality that is older is of before the loop, or the machine, stood still

# chronyd slews the system's clock by 83,333 ppm at most. By what it went otherwise than the truth in the last second it
# may do so in the next; what is more was a step, and says nothing of the second to come.
MOST_SLEWED_NS = 100_000_000  # in a second

GOOD_NS = 100_000_000  # a message of a receiver is later than this at times, and its station says no bound of its own

log = logging.getLogger("captain.time")


class Timekeeper:
    """Nothing but a look at the kernel's word once a second, for a station that has neither pulses nor a receiver.

    own         ITS time of the station, which goes by the estimate where there is one.
    tell        is given the quality of each second, once it has begun.
    simulation  plays the pulses of a simulated board.
    clocks      of the machine; None: its own.
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
        self._offset_ns: int | None = None  # a second ago
        self._is_running = False
        self._doubt = ""  # of the table that was read
        self._told_at = loop.clock()

    def start(self, announcing: Collection[str]) -> None:
        """Open what there is, in the next turn: the first message shall not wait for it.

        announcing  interfaces whose receivers announce pulses.
        """
        self._announcing = announcing
        self._receiver = receivers.chosen(self._options, self._pulse, announcing)
        self._is_running = True
        self._loop.soon(self._open)

    def stop(self) -> None:
        """Idempotent."""
        self._is_running = False
        pulsed, self._pulsed = self._pulsed, None  # what drivers still say as they stop is too late
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
        """The part of the status that is about time."""
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
        """{"do": "time"}: the status, and how it was in the last hour, as far as a line of text has room for it;
        with "history": true all that is kept, in the form of firmware/time_history.py.
        """
        told: dict[str, object] = {}
        if self._pulsed is not None:
            kept = self._pulsed.history
            told = kept.told() if question.get("history") is True else kept.brief()
        return {"clock": self.status(), "history": told}

    def _open(self) -> None:
        if not self._is_running:
            return
        from board.leaps import known
        from firmware.system_clock import SystemClock

        options = self._options
        self._own.leaps = leaps = known(options.leap_list, time.time())
        self._doubt = leaps.doubt
        if leaps.doubt:
            log.warning("%s", leaps.doubt)
        if self._receiver:
            self._pulsed = self._made(self._receiver)
            self._own.estimated = self._pulsed.its_ms
            self._pulsed.start()
        is_asked = options.tracking or (options.tracking is None and bool(options.chrony))
        self._system = SystemClock(self._loop, is_asked, self._own.is_system_set)
        self._system.start()
        self._loop.after(PERIOD_S, self._second)

    def _made(self, receiver: str) -> "PulsedTime":
        from firmware.pulse_input import source
        from firmware.pulsed_time import PulsedTime
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

    def _second(self) -> None:
        if not self._is_running:
            return
        self._loop.after(PERIOD_S, self._second)
        self.renew()

    def renew(self) -> None:
        """Tell the quality of now."""
        if not self._is_running or self._system is None:
            return
        quality = self._pulsed.quality(self._system.chronyds_ns()) if self._pulsed else TimeQuality()
        self.quality = self._of_the_second(self._system.quality() if quality.state is Lock.UNKNOWN else quality)
        self._own.is_system_good = self.quality.state is Lock.SYSTEM and (self.quality.error_ns or GOOD_NS) < GOOD_NS
        self._told_at = self._loop.clock()
        self._tell(self.quality)

    def _of_the_second(self, quality: TimeQuality) -> TimeQuality:
        """A quality of now, good for the second that begins: the offset goes on as it did in the last one."""
        before_ns, self._offset_ns = self._offset_ns, quality.offset_ns
        if before_ns is None or quality.offset_ns is None or quality.uncertainty_ns is None:
            return quality
        changed_ns = abs(quality.offset_ns - before_ns)
        if changed_ns > MOST_SLEWED_NS:
            return quality
        return quality._replace(uncertainty_ns=quality.uncertainty_ns + changed_ns)

    def _leap_status(self, its_ms: int | None) -> dict[str, object] | None:
        """Whose leap seconds are used, until when they are known, and what is to come."""
        leaps = self._own.leaps
        if leaps is None:
            return None
        event = None if its_ms is None else leaps.next(its_ms * 1_000_000)
        is_settled = leaps.base is not None and leaps.doubt == self._doubt  # the list matters no more
        return {
            "table": leaps.source,
            "expires": leaps.expires,
            "doubt": "" if is_settled else leaps.doubt,
            "seconds": None if its_ms is None else leaps.leap_seconds(its_ms * 1_000_000),
            "event": event and {**event._asdict(), "utc": leaps.civil(event.its_s * 1_000_000_000)},
        }

    def _missing(self) -> str:
        """What to do for a better time, in words; empty where pulses come in, or why they do not is told with them."""
        if not self._receiver and len(self._announcing) > 1:
            names = " and ".join(self._announcing)
            return f"{names} announce pulses: captain.toml needs [time] with receiver, one of them"
        if not self._receiver:
            return 'no interface announces pulses: captain.toml needs one with driver = "zed_f9p" and pulse = true'
        if self._pulse is None:
            return "no input for pulses: the board file needs [pulse] with the device or line that they come to"
        return ""
