"""The one loop: descriptors, timers and nothing else. Nobody sleeps on it, nobody blocks it."""

import heapq
import itertools
import select
import time
from collections import deque
from collections.abc import Callable
from typing import Protocol

READ = select.EPOLLIN
WRITE = select.EPOLLOUT

# Descriptors served in one turn. All that are ready beyond these are served in the next: the kernel rotates.
MAX_EVENTS = 64


class Source(Protocol):
    """Something with a descriptor. ready() does a bounded amount of work and returns."""

    def fileno(self) -> int: ...
    def ready(self, events: int) -> None: ...


class Timer:
    """A call that will be made once; cancel() is idempotent and may come after the call."""

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
    """A select loop on epoll with timers on a monotonic clock.

    clock  seconds that never go back; a fake one in tests.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.clock = clock
        self._epoll = select.epoll()
        self._sources: dict[int, Source] = {}
        self._removed: set[int] = set()  # in this turn
        self._timers: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()
        self._soon: deque[Callable[[], None]] = deque()
        self._is_running = False

    def add(self, source: Source, events: int = READ) -> None:
        """Serve a source from now on; events is a mask of READ and WRITE; a broken one is served whatever it wants."""
        descriptor = source.fileno()
        self._epoll.register(descriptor, events)
        self._sources[descriptor] = source

    def want(self, source: Source, events: int) -> None:
        """Change what a source waits for."""
        self._epoll.modify(source.fileno(), events)

    def remove(self, source: Source) -> None:
        """Stop serving a source, before its descriptor is closed; one that was never added is ignored."""
        descriptor = source.fileno()
        if self._sources.get(descriptor) is source:
            del self._sources[descriptor]
            self._removed.add(descriptor)
            self._epoll.unregister(descriptor)

    def after(self, delay: float, call: Callable[[], None]) -> Timer:
        """Call once, delay seconds from now."""
        timer = Timer(self.clock() + delay, call)
        heapq.heappush(self._timers, (timer.when, next(self._order), timer))
        return timer

    def every(self, period: float, call: Callable[[], None]) -> None:
        """Call now and then each period for as long as the loop turns; what a pause has missed is left out."""
        due = self.clock()

        def again() -> None:
            nonlocal due
            call()
            now = self.clock()
            due += period * (int((now - due) / period) + 1)
            self.after(due - now, again)

        again()

    def soon(self, call: Callable[[], None]) -> None:
        """Call once in the next turn, after the descriptors of this one had theirs."""
        self._soon.append(call)

    def run(self) -> None:
        """Turn until stop() is called. What a callback raises passes through: it is a bug, not an event."""
        self._is_running = True
        while self._is_running:
            self.turn()

    def stop(self) -> None:
        """Leave run() at the end of this turn."""
        self._is_running = False

    def turn(self) -> None:
        """One turn: wait for descriptors or the next timer, then serve each that is due once."""
        sources, removed = self._sources, self._removed
        removed.clear()
        for descriptor, events in self._wait():
            # What is removed in this turn leaves its event behind, and a new source may have its number already.
            if descriptor not in removed:
                sources[descriptor].ready(events)
        self._serve_timers()
        for _ in range(len(self._soon)):
            self._soon.popleft()()

    def close(self) -> None:
        self._epoll.close()

    def delay(self) -> float | None:
        """Seconds until something of our own is due: 0 for now, None for never."""
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
