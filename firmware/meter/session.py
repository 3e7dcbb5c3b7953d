"""A measurement over the network: watches stations, sends probes, and settles, until it is told to end."""

import time
from collections.abc import Callable

from board.errors import StationError
from firmware.meter.meter import Meter
from firmware.meter.prober import Prober
from firmware.meter.watch import Watch, registered
from firmware.user import client

LOOK_S = 0.1  # how often is settled
REDRAW_S = 1.0
CONFIRM_S = 0.5  # until a station's word is here of what has left it
CONFIRMS_S = 20.0  # the same of messages that one knows to be on their way, where the machine is busy


class TimeLine:
    """Unix time that never steps: that of the beginning, and from there the monotonic clock."""

    def __init__(self) -> None:
        self.began_s = time.time()
        self._monotonic = time.monotonic()

    def __call__(self) -> float:
        return self.began_s + time.monotonic() - self._monotonic


class Session:
    """Everything of one measurement.

    is_ending  nothing more is sent, and what is under way is waited for.
    is_cut     it was not waited for, and is in no figure.
    """

    def __init__(self, meter: Meter, line: TimeLine) -> None:
        self.meter = meter
        self.line = line
        self.watches: list[Watch] = []
        self.prober: Prober | None = None
        self.ended_s: float | None = None
        self.is_ending = self.is_cut = False
        self._looked = 0.0

    def watch(self, name: str, place: client.Address, context: client.Context, is_whole: bool = False) -> None:
        """Take up a station; is_whole: each message to its users. Raises StationError when it is not there."""
        self.watches.append(Watch(name, place, context, self.meter, self.line, self._delivered, is_whole))

    def begin(self, is_first: bool = False) -> None:
        """When all stations have joined, and what they said before was let go. Raises StationError.

        is_first  nothing has been sent until now.
        """
        for watch in self.watches:
            watch.join()
        self._check_others()
        # What one has sent a moment ago may have come to another before that was heard.
        self._until(self.line() + CONFIRM_S, lambda: None, is_sending=False)
        for watch in self.watches:
            watch.begin(is_first)

    def _check_others(self) -> None:
        """Raise StationError where two of them are one and the same."""
        known: dict[tuple[object, object], str] = {}
        for watch in self.watches:
            key = watch.status.get("boot"), watch.status.get("pid")
            if key in known and watch.boot:
                raise StationError(f"{known[key]} and {watch.name} are the same station", "name another with --at")
            known[key] = watch.name

    def run(self, for_s: float | None, idle: Callable[[], None], stopped: Callable[[], None]) -> None:
        """Until so many seconds are over, all probes are sent, or stop(), which is told; then until all is settled."""
        self._until(None if for_s is None else self.line() + for_s, idle, is_sending=True)
        if self.is_ending:
            stopped()
        self.is_ending = True
        if (prober := self.prober) is not None:
            watch = next(one for one in self.watches if one.name == prober.name)
            self.wait(lambda: watch.own.is_over(prober.count))
        self.end(idle)

    def stop(self) -> None:
        """End, or if it is ending already do not wait, between two turns: no fate is half counted. For a signal."""
        self.is_cut = self.is_ending
        self.is_ending = True

    @property
    def longest_end_s(self) -> float:
        """For so long it may wait for what is under way."""
        return CONFIRM_S + 2 * self.meter.grace_s + (0.0 if self.prober is None else CONFIRMS_S)

    def end(self, idle: Callable[[], None] = lambda: None) -> None:
        """What is still under way is waited for; what is sent from now on is not measured."""
        self.ended_s = self.line()
        self._until(self.ended_s + CONFIRM_S, idle, is_sending=False)
        for watch in self.watches:
            watch.end()
        self._until(self.line() + 2 * self.meter.grace_s, idle, is_sending=False)
        if not self.is_cut:
            self.meter.finish()

    def serve(self, for_s: float) -> None:
        """Take what comes for so long: for those who do something else meanwhile."""
        self.take()
        self._until(self.line() + for_s, lambda: None, is_sending=True)

    def wait_for(self, station: str, count: int, within_s: float = CONFIRMS_S) -> None:
        """Until a station has said of so many messages what became of them, or for so long."""
        self.wait(lambda: self.meter.inside.told(station) >= count, within_s)

    def wait(self, is_over: Callable[[], bool], within_s: float = CONFIRMS_S) -> None:
        """Take what comes until it is over, or for so long."""
        end_s = self.line() + within_s
        while not is_over() and self.line() < end_s and not self.is_cut:
            self._until(self.line() + LOOK_S, lambda: None, is_sending=False)

    def _until(self, end_s: float | None, idle: Callable[[], None], is_sending: bool) -> None:
        poller = registered(self.watches)
        redraw_s = self.line() + REDRAW_S
        while not (self.is_cut or (is_sending and self.is_ending)):
            now_s = self.line()
            if end_s is not None and now_s >= end_s:
                return
            wait_s = LOOK_S if end_s is None else min(LOOK_S, end_s - now_s)
            if is_sending and self.prober is not None:
                if self.prober.is_over:
                    return
                wait_s = min(wait_s, self.prober.due_s(now_s))
                if wait_s <= 0:
                    self.prober.send(now_s, time.monotonic_ns)
                    wait_s = 0.0
            poller.poll(int(wait_s * 1000))
            self.take()
            if now_s >= redraw_s:
                redraw_s = now_s + REDRAW_S
                idle()

    def take(self) -> None:
        """What has come, and what is known of it by now."""
        for watch in self.watches:
            watch.take()
        now_s = self.line()
        if now_s >= self._looked + LOOK_S:
            self._looked = now_s
            for watch in self.watches:
                watch.look(now_s)
            self.meter.settle(min(watch.judged_until(now_s) for watch in self.watches))

    def _delivered(self, station: str, digest: str, now_ns: int) -> None:
        if self.prober is not None:
            self.prober.delivered(station, digest, now_ns)
