"""The one queue towards an interface: bounded, most urgent first, nothing older than its lifetime."""

from collections import deque
from typing import Protocol

from board.loop import Loop, Timer
from drivers.contract import BUSY, LATER, NOW, Sent
from drivers.message import Request
from drivers.reason import Reason

PRIORITIES = 8
BATCH = 64  # requests handed over in one turn: a long queue must not hold up the rest
SWEEP_S = 0.2  # how soon after its lifetime a waiting request is given up
LATE_S = 0.002  # the grain of epoll's timer: what it comes late by is caught up, a pause is not


class Outgoing(Protocol):
    """The interface behind a queue: it sends, and it is told what became of each request."""

    is_up: bool

    def transmit(self, request: Request) -> Sent | None:
        """Give it to the driver; None where the driver can never send it, which was dropped and told."""

    def sent(self, request: Request, handed_over: float) -> None: ...
    def dropped(self, request: Request, reason: Reason, handed_over: float | None = None, detail: str = "") -> None: ...


class Outlet:
    """Requests that wait for one interface.

    capacity  requests that may wait; one more pushes out the oldest of the lowest priority.
    gap_s     the time between two that leave, less what a timer was late by; 0 paces nothing.
    """

    def __init__(self, loop: Loop, interface: Outgoing, capacity: int, gap_s: float = 0.0) -> None:
        self.capacity = capacity
        self.length = 0
        self.longest = 0
        self._clock = loop.clock
        self._loop = loop
        self._interface = interface
        self._queues: list[deque[Request]] = [deque() for _ in range(PRIORITIES)]
        self._gap_s = gap_s
        self._next_at = 0.0
        self._is_busy = False
        self._is_scheduled = False
        self._pump_timer: Timer | None = None
        self._sweep_timer: Timer | None = None
        self._kept: dict[int, tuple[Request, float]] = {}

    def submit(self, request: Request) -> None:
        """Send it at once if nothing is in its way, else let it wait."""
        if self.length or self._is_busy or self._gap_s or not self._interface.is_up:
            self._push(request)
            if not self._is_busy:
                self._pump()
        elif self._hand_over(request) is BUSY:
            self._is_busy = True
            self._push(request)

    def writable(self) -> None:
        """The driver takes requests again, or its link came up."""
        self._is_busy = False
        self._pump()

    def confirm(self, request: Request, reason: Reason | None, detail: str = "") -> None:
        """What became of a request that the driver had kept; one that is not known is ignored."""
        handed_over = self._kept.pop(request.number, None)
        if handed_over is None:
            return
        if reason is None:
            self._interface.sent(request, handed_over[1])
        else:
            self._interface.dropped(request, reason, handed_over[1], detail)

    def drop_kept(self, reason: Reason) -> None:
        """The driver stopped: what it had taken and not confirmed is gone."""
        kept, self._kept = self._kept, {}
        for request, handed_over in kept.values():
            self._interface.dropped(request, reason, handed_over)

    def drop_all(self, reason: Reason) -> None:
        """Give up all that wait or are kept by the driver."""
        self.drop_kept(reason)
        for queue in self._queues:
            while queue:
                self._interface.dropped(queue.popleft(), reason)
        self.length = 0

    @property
    def is_empty(self) -> bool:
        return not self.length and not self._kept

    def _push(self, request: Request) -> None:
        if self.length >= self.capacity:
            lowest = max(place for place, queue in enumerate(self._queues) if queue)
            if lowest < request.priority:
                self._interface.dropped(request, Reason.QUEUE_FULL)
                return
            self._interface.dropped(self._queues[lowest].popleft(), Reason.QUEUE_FULL)
            self.length -= 1
        self._queues[request.priority].append(request)
        self.length += 1
        self.longest = max(self.longest, self.length)
        if self._sweep_timer is None:
            self._sweep_timer = self._loop.after(SWEEP_S, self._sweep)

    def _pump(self) -> None:
        """Hand over what may leave now; come back by timer for what may leave later."""
        for _ in range(BATCH):
            if not self.length or self._is_busy or not self._interface.is_up:
                return
            now = self._clock()
            if self._gap_s and now < self._next_at:
                if self._pump_timer is None:
                    self._pump_timer = self._loop.after(self._next_at - now, self._pump_again)
                return
            queue = next(queue for queue in self._queues if queue)
            request = queue.popleft()
            self.length -= 1
            if request.deadline < now:
                self._interface.dropped(request, Reason.EXPIRED)
            elif self._hand_over(request) is BUSY:
                self._is_busy = True
                queue.appendleft(request)
                self.length += 1
            elif self._gap_s:
                self._next_at = max(self._next_at, now - LATE_S) + self._gap_s
        if self.length and not self._is_scheduled:
            self._is_scheduled = True
            self._loop.soon(self._pump_on)

    def _pump_on(self) -> None:
        self._is_scheduled = False
        self._pump()

    def _pump_again(self) -> None:
        self._pump_timer = None
        self._pump()

    def _hand_over(self, request: Request) -> Sent | None:
        handed_over = self._clock()
        sent = self._interface.transmit(request)
        if sent is NOW:
            self._interface.sent(request, handed_over)
        elif sent is LATER:
            self._kept[request.number] = request, handed_over
        return sent

    def _sweep(self) -> None:
        """Give up what is too old while nothing moves, so that its user hears of it."""
        self._sweep_timer = None
        now = self._clock()
        reason = Reason.EXPIRED if self._interface.is_up else Reason.LINK_DOWN
        for queue in self._queues:
            for _ in range(len(queue)):
                request = queue.popleft()
                if request.deadline < now:
                    self.length -= 1
                    self._interface.dropped(request, reason)
                else:
                    queue.append(request)
        if self.length:
            self._sweep_timer = self._loop.after(SWEEP_S, self._sweep)
