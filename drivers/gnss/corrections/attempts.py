"""Retries of a source of corrections, with back-off and few journal lines."""

import logging
from collections.abc import Callable

from board.runtime.journal import REPEATS, Journal
from board.runtime.loop import Timer
from drivers.contract import Host
from drivers.gnss.corrections.frames import Frames

log = logging.getLogger("captain.gnss")

FIRST_S, MOST_S = 1.0, 60.0  # shortest and longest delay between two tries, in seconds
SETTLED_S = 10.0  # after an attempt that lasted at least this long and had frames, the delay is FIRST_S again


class Attempts:
    """Repeats a failed attempt after a delay that doubles. The same failure is logged once, with a rate limit for all.

    source  name of the source, for messages.
    frames  frames of the source.
    """

    def __init__(self, source: str, host: Host, frames: Frames) -> None:
        self._source = source
        self._loop = host.loop
        self._frames = frames
        self._journal = Journal(log, host.name, host.loop.clock, REPEATS)
        self._timer: Timer | None = None
        self._delay = FIRST_S
        self._why = ""
        self._begun, self._begun_count = host.loop.clock(), frames.count

    def begin(self) -> None:
        """Note the start of an attempt."""
        self._begun, self._begun_count = self._loop.clock(), self._frames.count

    @property
    def has_frames(self) -> bool:
        """Whether this attempt has yielded frames."""
        return self._frames.count > self._begun_count

    def failed(self, why: str, again: Callable[[], None]) -> None:
        """Note the end of an attempt, with its reason; call again() after the delay."""
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
        """Call a function after a time; it replaces the call that was planned before."""
        self.close()
        self._timer = self._loop.after(seconds, call)

    def close(self) -> None:
        """Cancel the planned call; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
