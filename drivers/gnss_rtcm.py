"""What the sources of corrections have in common: octets to RTCM 3 frames, and when a source that failed is tried."""

import logging
from collections.abc import Callable

from board.journal import REPEATS, Journal
from board.loop import Timer
from drivers.contract import Host
from drivers.reason import Reason
from drivers.wire.garbage import Garbage
from drivers.wire.gnss_stream import GnssStream
from drivers.wire.rtcm import Frame

log = logging.getLogger("captain.gnss")

Take = Callable[[bytes], None]

BATCH = 1024  # octets read in one turn
FIRST_S, MOST_S = 1.0, 60.0  # between two tries
SETTLED_S = 10.0  # what gave frames for so long is tried at once when it fails


class Frames:
    """Octets to frames, counted; only whole ones are passed on."""

    def __init__(self, host: Host, take: Take) -> None:
        self.count = 0
        self.garbage = 0  # octets since the last frame
        self.last: float | None = None
        self._host = host
        self._take = take
        self._stream = GnssStream()

    def receive(self, octets: bytes) -> None:
        now = self._host.loop.clock()
        for event in [*self._stream.expire(now), *self._stream.receive(octets, now)]:
            if isinstance(event, Frame):
                self.count += 1
                self.garbage, self.last = 0, now
                self._take(event.octets)
            elif isinstance(event, Garbage):
                self.garbage += event.octets
                self._host.drop(event.reason, event.sample)
            else:
                self._host.drop(Reason.FRAMING)

    def details(self) -> dict[str, object]:
        since = None if self.last is None else round(self._host.loop.clock() - self.last, 1)
        return {"frames": self.count, "last_s": since}


class Attempts:
    """Calls again after each failure, ever later; the same failure is logged once, and any of them seldom.

    source  for people.
    """

    def __init__(self, source: str, host: Host, frames: Frames) -> None:
        self._source = source
        self._loop = host.loop
        self._frames = frames
        self._journal = Journal(log, host.name, host.loop.clock, REPEATS)
        self._timer: Timer | None = None
        self._delay = FIRST_S
        self._why = ""
        self.begin()

    def begin(self) -> None:
        """An attempt begins."""
        self._begun, self._begun_count = self._loop.clock(), self._frames.count

    @property
    def has_frames(self) -> bool:
        """Whether this attempt gave any."""
        return self._frames.count > self._begun_count

    def failed(self, why: str, again: Callable[[], None]) -> None:
        """It ended; again() is called when it may be tried again."""
        if self.has_frames:
            self._why = ""
            if self._loop.clock() - self._begun >= SETTLED_S:
                self._delay = FIRST_S
        if why != self._why:
            self._why = why
            text = f"corrections from {self._source}: {why}; trying again, at most every {MOST_S:.0f} s"
            self._journal.say(logging.WARNING, text)
        self.wait(self._delay, again)
        self._delay = min(MOST_S, 2 * self._delay)

    def wait(self, seconds: float, call: Callable[[], None]) -> None:
        """Call so much later, in place of what was to be called."""
        self.close()
        self._timer = self._loop.after(seconds, call)

    def close(self) -> None:
        """Nothing is called any more; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
