"""A loop whose clock stands still while descriptors are ready, and jumps to the next timer when none is.

A test of ten minutes takes as long as its callbacks, and takes it in the same order every time: the order of
epoll for descriptors (that in which they became ready), the order of their moments for timers.
"""

from collections.abc import Callable

from board.loop import MAX_EVENTS, Loop

# Real seconds for what is known to be on its way: it takes microseconds, and milliseconds beside other programs.
CARRY_S = 1.0


class VirtualLoop(Loop):
    """A board.loop.Loop with a clock of its own, which starts at `now`.

    patience_s  real seconds that a descriptor is given to become ready before the clock jumps: 0 for sockets of
                one process on loopback, which are ready at once; more where a thread or a child has the other end.
    is_carrying  whether octets are on their way that will make a descriptor ready: it is then given CARRY_S.
    """

    def __init__(self, now: float = 1000.0, patience_s: float = 0.0) -> None:
        super().__init__(clock=lambda: self.now)
        self.now = now
        self.patience_s = patience_s
        self.is_carrying: Callable[[], bool] = lambda: False

    def run_until(self, is_done: Callable[[], bool], within: float = 60.0) -> None:
        """Turn until something is so. Fails when it is not within so many virtual seconds."""
        end = self.after(within, lambda: None)
        while not is_done():
            assert end.is_pending, f"not so within {within} virtual seconds"
            self.turn()
        end.cancel()

    def run_for(self, seconds: float) -> None:
        """Turn until so many virtual seconds have gone by; what is due at their end is served."""
        end = self.after(seconds, lambda: None)
        while end.is_pending:
            self.turn()

    def _wait(self) -> list[tuple[int, int]]:
        delay = self.delay()
        patience_s = CARRY_S if self.is_carrying() else self.patience_s
        ready = self._epoll.poll(patience_s if delay != 0 else 0, MAX_EVENTS)
        if not ready:
            self.now += delay or 0.0  # without a timer nothing will happen: time stays
        return ready
