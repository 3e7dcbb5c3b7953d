"""Event loop: descriptors and timers. Code on it never sleeps or blocks."""

import heapq
import itertools
import select
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

READ = select.EPOLLIN
WRITE = select.EPOLLOUT

# Most descriptors served in one turn. The others are served in the next turn, because the kernel rotates them.
MAX_EVENTS = 64


class Source(Protocol):
    """Object with a descriptor. ready() does a bounded amount of work and returns."""

    def fileno(self) -> int: ...
    def ready(self, events: int) -> None: ...


class Timer:
    """Single call at a later time; cancel() is idempotent and may come after the call."""

    __slots__ = ("call", "when")

    def __init__(self, when: float, call: Callable[[], None]) -> None:
        self.when = when
        self.call: Callable[[], None] | None = call

    def cancel(self) -> None:
        self.call = None

    @property
    def is_pending(self) -> bool:
        return self.call is not None


class Loop:
    """Event loop on epoll, with timers on a monotonic clock.

    clock  monotonic seconds; a simulated clock in tests.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.clock = clock
        self._epoll = select.epoll()
        self._sources: dict[int, Source] = {}
        self._removed: set[int] = set()  # descriptors removed in this turn
        self._timers: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()
        self._soon: deque[Callable[[], None]] = deque()
        self._is_running = False

    def add(self, source: Source, events: int = READ) -> None:
        """Serve a source; events is a mask of READ and WRITE. A broken descriptor is served whatever the mask."""
        descriptor = source.fileno()
        self._epoll.register(descriptor, events)
        self._sources[descriptor] = source

    def want(self, source: Source, events: int) -> None:
        """Change the events that a source waits for."""
        self._epoll.modify(source.fileno(), events)

    def remove(self, source: Source) -> None:
        """Stop serving a source; call it before its descriptor is closed. A source that was not added is ignored."""
        descriptor = source.fileno()
        if self._sources.get(descriptor) is source:
            del self._sources[descriptor]
            self._removed.add(descriptor)
            self._epoll.unregister(descriptor)

    def after(self, delay: float, call: Callable[[], None]) -> Timer:
        """Call once after `delay` seconds; return the timer, which can be cancelled."""
        timer = Timer(self.clock() + delay, call)
        heapq.heappush(self._timers, (timer.when, next(self._order), timer))
        return timer

    def every(self, period: float, call: Callable[[], None]) -> None:
        """Call now and then once per period, as long as the loop runs; calls missed in a pause are skipped."""
        due = self.clock()

        def again() -> None:
            nonlocal due
            call()
            now = self.clock()
            due += period * (int((now - due) / period) + 1)
            self.after(due - now, again)

        again()

    def soon(self, call: Callable[[], None]) -> None:
        """Call once at the end of this turn, or of the next if called from such a call."""
        self._soon.append(call)

    def run(self) -> None:
        """Run turns until stop(). An exception of a callback is a bug and passes through."""
        self._is_running = True
        while self._is_running:
            self.turn()

    def stop(self) -> None:
        """Leave run() at the end of this turn."""
        self._is_running = False

    def turn(self) -> None:
        """Wait for descriptors or the next timer, then serve each that is due once."""
        sources, removed = self._sources, self._removed
        removed.clear()
        for descriptor, events in self._wait():
            # The event of a source removed in this turn remains, and a new source may have the same descriptor.
            if descriptor not in removed:
                sources[descriptor].ready(events)
        self._serve_timers()
        for _ in range(len(self._soon)):
            self._soon.popleft()()

    def close(self) -> None:
        self._epoll.close()

    def delay(self) -> float | None:
        """Return seconds until the next timer or call is due: 0 for now, None for never."""
        if self._soon:
            return 0.0
        timers = self._timers
        while timers and timers[0][2].call is None:
            heapq.heappop(timers)
        if not timers:
            return None
        return max(0.0, timers[0][0] - self.clock())

    def _wait(self) -> list[tuple[int, int]]:
        return self._epoll.poll(self.delay(), MAX_EVENTS)

    def _serve_timers(self) -> None:
        timers = self._timers
        if not timers:
            return
        now = self.clock()
        while timers and timers[0][0] <= now:
            timer = heapq.heappop(timers)[2]
            call = timer.call
            timer.call = None
            if call is not None:
                call()
