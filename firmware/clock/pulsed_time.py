"""Pulsed time: pairs pulses with announced seconds, estimates time, feeds chronyd."""

import logging
import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from board.runtime.journal import REPEATS, Journal
from board.runtime.loop import Loop, Timer
from board.time.leaps import BUILT_IN
from board.time.scales import Fix, LeapEvent, Lock, TimeMark, TimeQuality
from firmware.clock.own_time import OwnTime
from firmware.clock.pulse_input import PulseInput
from firmware.clock.time_history import SecondRow, TimeHistory
from pps.pulse import Above, Clocks, Pulse, Pulses
from pps.quality import Estimator
from pps.refused import MEANING, Refused, Why
from pps.timemark import Acquired, Event, Pairing, Second

if TYPE_CHECKING:
    from pps.chrony.feed import Refclock

SAME_S = 0.01  # tolerance for the comparison of two computations of the same age
# Seconds without a pulse after which the history gets rows without pulses. The row of a second with a pulse is added
# only 0.9 s after the pulse.
GAP_S = 2.5

log = logging.getLogger("captain.time")


class PulsedTime:
    """Time by the pulses and messages of one receiver.

    receiver    interface of the receiver, whose fixes and time marks are used.
    make        returns the source of the receiver's pulses; None: no pulses, so the time comes only from messages.
    latency_ns  largest latency of the pulses' time stamps, which cannot be measured from the pulses.
    chrony      path of the socket of chronyd that gets the pulses; empty: none.
    own         converts messages to ITS time. Its leap-second table is used until the receiver reports leap seconds,
                and is then replaced.
    clocks      reads all clocks of the machine at once.
    """

    def __init__(
        self,
        loop: Loop,
        receiver: str,
        make: Callable[[Above], Pulses] | None,
        latency_ns: int,
        chrony: str,
        own: OwnTime,
        clocks: Callable[[], Clocks],
    ) -> None:
        self.receiver = receiver
        self.leaps = leaps = own.leaps or BUILT_IN
        self.seconds = self.late = 0
        self.history = TimeHistory()
        self._loop = loop
        self._own = own
        self._clocks = clocks
        self._pairing = Pairing()
        self._estimator = Estimator(latency_ns, leaps, receiver)
        self._input = PulseInput(loop, make, self.pulse) if make else None
        self._journal = Journal(log, receiver or "pulses", loop.clock, REPEATS)
        self._refclock = self._made_refclock(chrony)
        self._timer: Timer | None = None
        self._due: float | None = None  # deadline for which the timer is set
        self._phase: tuple[int, int] | None = None  # origin of phases: ITS second and raw clock of the first pulse
        self._state = Lock.UNKNOWN
        self._anchor: tuple[int, int] | None = None  # ITS time in ns and raw clock of the last second; None if unknown

    def start(self) -> None:
        if self._input is not None:
            self._input.start()

    def stop(self) -> None:
        """Close the pulse input and the socket to chronyd; a second call has no effect."""
        if self._input is not None:
            self._input.stop()
        if self._timer is not None:
            self._timer.cancel()
        if self._refclock is not None:
            self._refclock.close()

    # Reports of the receiver and its pulses.

    def mark(self, mark: TimeMark) -> None:
        if self._input is None and mark.is_locked and mark.its_s is not None:
            self._learn(mark.leap_seconds, mark.leap_event, mark.its_s)
        self._take(self._pairing.mark(mark))

    def fix(self, fix: Fix) -> None:
        told = self._own.told(fix)
        if told is not None and fix.utc_accuracy_ns is not None:  # without an accuracy, the leap seconds may be guessed
            now = self._clocks()
            self._estimator.message(
                round(told.its_ms * 1e6), now.raw_ns - round((now.monotonic - told.monotonic) * 1e9)
            )
        self._take(self._pairing.fix(fix))

    def pulse(self, pulse: Pulse) -> None:
        self._take(self._pairing.pulse(pulse))

    # Time and its quality.

    def its_ms(self, monotonic: float) -> int | None:
        """Return the ITS time in ms at a time of the loop's clock; None if unknown.

        This is called for each sent packet. The time is extrapolated from the last second by the raw oscillator, with
        an error of at most 0.1 ms. The loop's clock is not precise enough: chronyd may slew it by 80 ms in a second.
        """
        if self._anchor is None:
            return None
        its_ns, at_ns = self._anchor
        return (its_ns + raw_ns() - at_ns - round((self._loop.clock() - monotonic) * 1e9)) // 1_000_000

    def quality(self, systems_ns: int | None = None) -> TimeQuality:
        """Return the current quality of the time. The timekeeper calls this once a second.

        systems_ns  error bound of the system clock in ns, from chronyd; None if unknown.
        """
        now = self._clocks()
        # chronyd is not an independent source if this station feeds it.
        if systems_ns is not None and self._refclock is None:
            self._estimator.system(0, systems_ns, now.raw_ns)
        quality, best = self._estimator.quality(now), self._estimator.best(now)
        self._anchor = (best.its_ns, now.raw_ns) if best else None
        if quality.state is not self._state:
            self._journal.say(logging.INFO, _sentence(self._state, quality), quality.state.name)
            self._state = quality.state
        if quality.age_s is not None and quality.age_s > GAP_S and quality.offset_ns is not None:
            self._record(self.leaps.its_ns(now.system_ns + quality.offset_ns) / 1e9, math.nan, quality)
        return quality

    def status(self) -> dict[str, object]:
        """Return the part of the status about pulses and chronyd.

        receiver               interface of the receiver; empty without a receiver.
        pulse                  input of pulses; null without an input.
        refclock               socket of chronyd; null without `time.chrony`.
        pulse.seconds          number of accepted pulses.
        pulse.late             number of accepted pulses that the estimate ignored because they were too late.
        pulse.surprises        number of times that the error exceeded its stated bound when pulses came back.
        pulse.refused          refused pulses: a row for each reason.
        pulse.refused.reason   reason of the refusal.
        pulse.refused.meaning  meaning of the reason.
        pulse.refused.count    number of refused pulses.
        pulse.refused.time     Unix time of the last refused pulse.
        pulse.refused.detail   cause of the last refusal.
        """
        last = self._pairing.samples
        refusals = [
            {
                "reason": why,
                "meaning": MEANING[why],
                "count": count,
                "time": last[why].pulse.system_ns / 1e9,
                "detail": last[why].detail,
            }
            for why, count in self._pairing.refused.items()
        ]
        pulse = self._input.status() if self._input else None
        counts = {"seconds": self.seconds, "late": self.late, "surprises": self._estimator.surprises}
        return {
            "receiver": self.receiver,
            "pulse": pulse and {**pulse, **counts, "refused": refusals},
            "refclock": self._refclock.status() if self._refclock else None,
        }

    def _learn(self, leap_seconds: int | None, event: LeapEvent | None, its_s: int) -> None:
        if leap_seconds is None:
            return
        leaps = self.leaps.told(leap_seconds, event, its_s)
        if leaps is self.leaps:
            return
        if leaps.doubt and leaps.doubt != self.leaps.doubt:
            log.warning("%s", leaps.doubt)
        self.leaps = self._estimator.leaps = self._own.leaps = leaps

    def _take(self, found: list[Event]) -> None:
        for one in found:
            match one:
                case Second():
                    self._second(one)
                case Refused():
                    self._refuse(one)
                case Acquired():
                    self._acquired(one)
        self._wait()

    def _wait(self) -> None:
        """Set the timer to the next deadline of the pairing."""
        due = self._pairing.deadline()
        if due == self._due:
            return
        if self._timer is not None:
            self._timer.cancel()
        self._due = due
        self._timer = None if due is None else self._loop.after(due - self._loop.clock(), self._expire)

    def _expire(self) -> None:
        self._due = None
        self._take(self._pairing.expire(self._loop.clock()))

    def _second(self, second: Second) -> None:
        self.seconds += 1
        # These leap seconds agree with the UTC of this second.
        self._learn(second.leap_seconds, second.leap_event, second.its_s)
        now, pulse = self._clocks(), second.pulse
        self._estimator.second(second)
        quality = self._estimator.quality(now)
        # True if this pulse is the last one that the estimator has accepted.
        is_taken = quality.age_s is not None and quality.age_s - (now.raw_ns - pulse.raw_ns) / 1e9 < SAME_S
        self.late += not is_taken
        if self._refclock is not None and is_taken:
            unix_ns = self.leaps.unix_ns(second.its_s * 1_000_000_000) + self._estimator.model.late_ns
            self._refclock.sample(pulse, second.its_s, unix_ns, second.leap_event, now)
        if self._phase is None:
            self._phase = second.its_s, pulse.raw_ns
        phase_ns = pulse.raw_ns - self._phase[1] - (second.its_s - self._phase[0]) * 1_000_000_000
        self._record(second.its_s, phase_ns if is_taken else math.nan, quality)

    def _record(self, its_s: float, phase_ns: float, quality: TimeQuality) -> None:
        known = (quality.offset_ns, quality.uncertainty_ns, quality.jitter_ns)
        offset_ns, uncertainty_ns, jitter_ns = (math.nan if one is None else float(one) for one in known)
        self.history.add(SecondRow(its_s, offset_ns, uncertainty_ns, jitter_ns, phase_ns))

    def _refuse(self, refused: Refused) -> None:
        if refused.why is not Why.ACQUIRING:
            # A receiver without satellites may give invalid pulses: no warning before the first accepted one.
            level = logging.WARNING if self.seconds else logging.INFO
            text = f"a pulse is refused: {MEANING[refused.why]} ({refused.detail})"
            self._journal.say(level, text, refused.why)

    def _acquired(self, acquired: Acquired) -> None:
        if acquired.change_s:
            change = f"{acquired.change_s:+d} s compared with the station's count: the count or the receiver is wrong"
            self._journal.say(logging.ERROR, f"the receiver's time is used again: {change}", "acquired")

    def _made_refclock(self, path: str) -> "Refclock | None":
        if not path:
            return None
        from pps.chrony.feed import Refclock

        return Refclock(path, Journal(log, "chrony", self._loop.clock))


def raw_ns() -> int:
    """Return CLOCK_MONOTONIC_RAW in ns, which counts the oscillator without steering by NTP."""
    return time.clock_gettime_ns(time.CLOCK_MONOTONIC_RAW)


def _sentence(before: Lock, quality: TimeQuality) -> str:
    """Return a sentence for the log about the new state and the state before."""
    bound = "" if quality.uncertainty_ns is None else f", within {quality.uncertainty_ns / 1000:,.1f} us"
    words = {
        Lock.UNKNOWN: "the time is unknown",
        Lock.SYSTEM: "the time comes from the system clock",
        Lock.COARSE: "the time comes from the receiver's messages",
        Lock.SETTLING: "pulses arrive; a few more are needed",
        Lock.LOCKED: "the time comes from the receiver's pulses",
        Lock.HOLDOVER: "no good pulses: the time continues by the oscillator",
    }
    return f"{words[quality.state]}{bound} ({before.name.lower()} before)"
