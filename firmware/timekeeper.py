"""What time it is and how well that is known: the best word there is, told once a second to all who need it."""

import logging
import time
from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

from board.description import PulseDescription
from board.errors import InterfaceError
from board.loop import Loop
from board.time import EPOCH, Fix, Lock, TimeMark, TimeQuality
from firmware import receivers
from firmware.own_time import OwnTime
from firmware.question import Question
from firmware.simulation import Simulation
from firmware.tables import TimeOptions

if TYPE_CHECKING:
    from firmware.pulsed_time import PulsedTime
    from pps.chrony_tracking import Tracker
    from pps.pulse import Above, Clocks, Pulses

PERIOD_S = 1.0

log = logging.getLogger("captain.time")


class Timekeeper:
    """Nothing but a look at the kernel's word once a second, for a station that has neither pulses nor a receiver.

    own         ITS time of the station, which is told by pulses where they tell it.
    tell        is given the quality of each second.
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
        self._tracker: Tracker | None = None
        self._is_running = False

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
        if self._pulsed is not None:
            self._pulsed.stop()
        if self._tracker is not None:
            self._tracker.stop()

    def fix(self, source: str, fix: Fix) -> None:
        if self._pulsed is not None and source == self._receiver:
            self._pulsed.fix(fix)

    def time_mark(self, source: str, mark: TimeMark) -> None:
        if self._pulsed is not None and source == self._receiver:
            self._pulsed.mark(mark)

    def status(self) -> dict[str, object]:
        """The part of the status that is about time."""
        quality = self.quality
        told = {key: value for key, value in quality._asdict().items() if key not in ("state", "leap", "source")}
        its_ms = self._own.its_ms(self._loop.clock())
        parts = self._pulsed.status() if self._pulsed else {"receiver": "", "pulse": None, "refclock": None}
        return {
            "state": quality.state.name.lower(),
            **told,
            "error_ns": quality.error_ns,
            "its_ms": its_ms,
            "leap": self._pulsed.leap_status() if self._pulsed else None,
            **parts,
            "tracking": self._tracked(),
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
        if self._receiver:
            self._pulsed = self._made(self._receiver)
            self._own.by_pulses = self._pulsed.its_ms
            self._pulsed.start()
        options = self._options
        if options.tracking or (options.tracking is None and options.chrony):
            from board.journal import Journal
            from pps.chrony_tracking import Tracker

            self._tracker = Tracker(self._loop, Journal(log, "chrony", self._loop.clock))
            self._tracker.start()
        self._loop.after(PERIOD_S, self._second)

    def _made(self, receiver: str) -> "PulsedTime":
        from board.leaps import known
        from firmware.pulse_input import source
        from firmware.pulsed_time import PulsedTime
        from pps.pulse import read_clocks

        leaps = known(self._options.leap_list, time.time())
        if leaps.doubt:
            log.warning("%s", leaps.doubt)
        pulse, clocks = self._pulse, self._clocks or read_clocks

        def made(above: "Above") -> "Pulses":
            assert pulse is not None
            if pulse.kind:
                return self._simulation.pulses(above, clocks)
            return source(self._loop, pulse, self._simulation.machine.dev, above, clocks)

        latency_ns = pulse.latency_ns if pulse else 0
        chrony = self._options.chrony
        return PulsedTime(self._loop, receiver, made if pulse else None, latency_ns, chrony, leaps, clocks)

    def _second(self) -> None:
        if not self._is_running:
            return
        self._loop.after(PERIOD_S, self._second)
        quality = self._pulsed.quality(self._word()) if self._pulsed else TimeQuality()
        self.quality = self._by_system() if quality.state is Lock.UNKNOWN else quality
        self._tell(self.quality)

    def _word(self) -> tuple[int, int] | None:
        """Offset and uncertainty of the system's clock in ns, as chronyd says."""
        latest = self._tracker.latest if self._tracker else None
        if latest is None or latest.offset_ns is None or latest.uncertainty_ns is None:
            return None
        return latest.offset_ns, latest.uncertainty_ns

    def _by_system(self) -> TimeQuality:
        """What is known without a receiver: chronyd's word, or the kernel's, or that the clock is set."""
        if time.time() < EPOCH:
            return TimeQuality()
        word = self._word() or _kernels_word()
        return TimeQuality(Lock.SYSTEM, *word) if word else TimeQuality(Lock.SYSTEM)

    def _tracked(self) -> dict[str, object] | None:
        tracker = self._tracker
        if tracker is None:
            return None
        return {"why": tracker.why, **(tracker.latest._asdict() if tracker.latest else {})}

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


def _kernels_word() -> tuple[int, int] | None:
    from pps.kernel_clock import kernel_clock

    try:
        uncertainty_ns = kernel_clock().uncertainty_ns
    except InterfaceError:
        return None
    return None if uncertainty_ns is None else (0, uncertainty_ns)
