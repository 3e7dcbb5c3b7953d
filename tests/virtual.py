"""Loop on virtual time: its clock jumps to the next timer.

A test of ten virtual minutes takes only as long as its callbacks, which always run in the same order. Descriptors are
served in the order of epoll, in which they became ready. Timers are served in the order of their times.
"""

from collections.abc import Callable

from board.runtime.loop import MAX_EVENTS, Loop

# Real seconds to wait for octets that are known to be in transit. They take microseconds, or milliseconds on a busy
# machine.
CARRY_S = 1.0


class VirtualLoop(Loop):
    """Loop of board.runtime.loop with a virtual clock.

    now          first time of the clock in seconds.
    patience_s   real seconds to wait for a descriptor before the clock jumps. 0 is enough for loopback sockets inside a
                 process, which are ready at once. Threads and child processes at the other end need more.
    is_carrying  returns True while octets are in transit to a descriptor; the loop then waits CARRY_S for it.
    """

    def __init__(self, now: float = 1000.0, patience_s: float = 0.0) -> None:
        super().__init__(clock=lambda: self.now)
        self.now = now
        self.patience_s = patience_s
        self.is_carrying: Callable[[], bool] = lambda: False

    def run_until(self, is_done: Callable[[], bool], within: float = 60.0) -> None:
        """Run the loop until is_done() returns True. Fail after `within` virtual seconds."""
        end = self.after(within, lambda: None)
        while not is_done():
            assert end.is_pending, f"not so within {within} virtual seconds"
            self.turn()
        end.cancel()

    def run_for(self, seconds: float) -> None:
        """Run the loop for a number of virtual seconds. Timers that are due at the end still run."""
        end = self.after(seconds, lambda: None)
        while end.is_pending:
            self.turn()

    def _wait(self) -> list[tuple[int, int]]:
        delay = self.delay()
        patience_s = CARRY_S if self.is_carrying() else self.patience_s
        ready = self._epoll.poll(patience_s if delay != 0 else 0, MAX_EVENTS)
        if not ready:
            self.now += delay or 0.0  # without a timer, the time does not change
        return ready
