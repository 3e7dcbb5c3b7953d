"""Simulated pulses, in place of a PPS device."""

from collections.abc import Callable

from board.runtime.loop import Loop, Timer
from pps.chain import SECOND_NS
from pps.pulse import Above, Clocks, Pulse, Tally, read_clocks

# Shortest wait after a timer that came too early. It prevents a busy loop when the simulated truth does not advance.
EARLY_NS = 1_000_000


def system_is_right(clocks: Clocks) -> int:
    """Return the system's clock as the true time; the default truth."""
    return clocks.system_ns


def no_latency() -> int:
    """Return the latency of an interrupt that is served at once."""
    return 0


class Simulated:
    """Pulse at each whole second of a simulated receiver, reported on the loop.

    Stamps are exact: the timer only wakes the loop, and the stamp is computed.

    truth       returns the receiver's time in ns for a reading of the clocks; only its fraction of a second counts.
                While it returns None, pulses pause.
    latency_ns  returns the lateness of each pulse's stamp.
    is_silent   no pulses. This and the next two may be changed at any time.
    late_ns     additional lateness of all pulses.
    double_ns   time from each pulse to a second, false one; 0: none.
    """

    where = "simulated pulses"

    def __init__(
        self,
        loop: Loop,
        above: Above,
        *,
        truth: Callable[[Clocks], int | None] = system_is_right,
        latency_ns: Callable[[], int] = no_latency,
        clocks: Callable[[], Clocks] = read_clocks,
    ) -> None:
        self.tally = Tally(above)
        self.is_silent = False
        self.late_ns = self.double_ns = 0
        self._loop = loop
        self._truth = truth
        self._latency_ns = latency_ns
        self._clocks = clocks
        self._sequence = 0
        self._shift_ns = 0  # lateness of the next pulse
        self._timers: list[Timer] = []

    def start(self) -> None:
        """Start reporting pulses; without effect if started already."""
        if not self._timers:
            self.tally.begin(self._sequence)
            self._wait()

    def stop(self) -> None:
        """Stop reporting; idempotent."""
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()
        self.tally.end()

    def _wait(self) -> None:
        """Wait for the next second; pulses are at least half a second apart, however their latencies differ."""
        self._shift_ns = self.late_ns + self._latency_ns()
        left_ns = SECOND_NS - (self._since_ns(self._clocks()) or 0)
        self._wake(left_ns if left_ns >= SECOND_NS // 2 else left_ns + SECOND_NS)

    def _wake(self, left_ns: int) -> None:
        self._timers = [self._loop.after(left_ns / 1e9, self._look)]

    def _since_ns(self, now: Clocks) -> int | None:
        """Return the time since the last pulse was due, or None while pulses pause."""
        truth = self._truth(now)
        return None if truth is None else (truth - self._shift_ns) % SECOND_NS

    def _look(self) -> None:
        now = self._clocks()
        since_ns = self._since_ns(now)
        if since_ns is None:
            self._wait()
        elif since_ns >= SECOND_NS // 2:  # the timer fired too early, or the simulated true time was changed meanwhile
            self._wake(max(EARLY_NS, SECOND_NS - since_ns))
        else:
            self._wait()
            self._tell_all(now, since_ns)

    def _tell_all(self, now: Clocks, ago_ns: int) -> None:
        if not self.is_silent:
            if self.double_ns:
                self._timers.append(self._loop.after(self.double_ns / 1e9, lambda: self._tell(self._clocks(), 0)))
            self._tell(now, ago_ns)

    def _tell(self, now: Clocks, ago_ns: int) -> None:
        self._sequence = (self._sequence + 1) % 2**32
        stamp = (now.system_ns - ago_ns, now.raw_ns - ago_ns, now.monotonic - ago_ns / 1e9)
        self.tally.take(Pulse(self._sequence, *stamp))
