"""Send queue of an interface: bounded, by priority, without expired requests."""

from collections import deque
from typing import Protocol

from board.runtime.loop import Loop, Timer
from drivers.contract import BUSY, LATER, NOW, Sent
from drivers.message import Request
from drivers.reason import Reason

PRIORITIES = 8
BATCH = 64  # number of requests handed to the driver per turn of the loop: a long queue must not delay other work
SWEEP_S = 0.2  # interval of the check for expired requests while the queue does not move
# Resolution of epoll's timer. A departure that is late by no more than this does not delay the following ones; a longer
# pause is not made up for.
LATE_S = 0.002


class Outgoing(Protocol):
    """Interface of a queue: sends requests and receives their outcomes (firmware.routing.interface.Interface)."""

    is_up: bool

    def transmit(self, request: Request) -> Sent | None:
        """Hand a request to the driver. Return None if the driver can never send it; it is then dropped."""

    def sent(self, request: Request, handed_over: float) -> None: ...
    def dropped(self, request: Request, reason: Reason, handed_over: float | None = None, detail: str = "") -> None: ...


class Outlet:
    """Send queue of one interface.

    capacity  number of requests that may wait. A further one displaces the oldest request of the lowest priority.
    gap_s     least time in seconds between two departures, apart from the timer's lateness; 0 disables pacing.
    longest   largest number of requests that have waited.
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
        """Send a request at once if possible, else queue it."""
        if self.length or self._is_busy or self._gap_s or not self._interface.is_up:
            self._push(request)
            if not self._is_busy:
                self._pump()
        elif self._hand_over(request) is BUSY:
            self._is_busy = True
            self._push(request)

    def writable(self) -> None:
        """Continue to send, because the driver accepts requests again or its link came up."""
        self._is_busy = False
        self._pump()

    def confirm(self, request: Request, reason: Reason | None, detail: str = "") -> None:
        """Take the outcome of a request for which the driver had answered LATER. Other requests are ignored.

        reason  drop reason; None if the request was sent.
        """
        handed_over = self._kept.pop(request.number, None)
        if handed_over is None:
            return
        if reason is None:
            self._interface.sent(request, handed_over[1])
        else:
            self._interface.dropped(request, reason, handed_over[1], detail)

    def drop_kept(self, reason: Reason) -> None:
        """Drop all requests that the driver has kept without a confirm, because it stopped."""
        kept, self._kept = self._kept, {}
        for request, handed_over in kept.values():
            self._interface.dropped(request, reason, handed_over)

    def drop_all(self, reason: Reason) -> None:
        """Drop all requests that wait or are kept by the driver."""
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
        """Hand the requests that may leave now to the driver; set a timer if pacing delays the next one."""
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
        """Drop expired requests and repeat this while requests wait, so that users get a confirm in time."""
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
