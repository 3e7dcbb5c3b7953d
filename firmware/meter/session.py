"""Measurement over the network: watches stations, sends probes, settles messages."""

import time
from collections.abc import Callable

from board.runtime.errors import StationError
from firmware.client import client
from firmware.meter.meter import Meter
from firmware.meter.prober import Prober
from firmware.meter.watch.station import Watch, registered

LOOK_S = 0.1  # interval of settling
REDRAW_S = 1.0
CONFIRM_S = 0.5  # seconds until a station's report of a sent message has surely arrived
CONFIRMS_S = 20.0  # the same for messages known to be under way, on a busy machine


class TimeLine:
    """Unix time that never steps: the system time at the start, continued by the monotonic clock."""

    def __init__(self) -> None:
        self.began_s = time.time()
        self._monotonic = time.monotonic()

    def __call__(self) -> float:
        return self.began_s + time.monotonic() - self._monotonic


class Session:
    """One measurement with all its stations.

    is_ending  no more probes are sent; messages under way are awaited.
    is_cut     the wait was cut short; messages under way are in no figure.
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
        """Add a station.

        is_whole  read all messages to its users, not only the first of each second.

        Raises StationError if the station does not answer.
        """
        self.watches.append(Watch(name, place, context, self.meter, self.line, self._delivered, is_whole))

    def begin(self, is_first: bool = False) -> None:
        """Begin measuring once all stations have joined; earlier reports are discarded.

        is_first  no message has been sent before.

        Raises StationError if a station does not answer, or two names mean the same station.
        """
        for watch in self.watches:
            watch.join()
        self._check_others()
        # Another station may report the reception of a message that was sent a moment ago, so reports are discarded a
        # while longer.
        self._until(self.line() + CONFIRM_S, lambda: None, is_sending=False)
        for watch in self.watches:
            watch.begin(is_first)

    def _check_others(self) -> None:
        """Raise StationError if two names mean the same station."""
        known: dict[tuple[object, object], str] = {}
        for watch in self.watches:
            key = watch.status.get("boot"), watch.status.get("pid")
            if key in known and watch.boot:
                raise StationError(f"{known[key]} and {watch.name} are the same station", "name another with --at")
            known[key] = watch.name

    def run(self, for_s: float | None, idle: Callable[[], None], stopped: Callable[[], None]) -> None:
        """Measure until the duration is over, all probes are sent, or stop() is called; then settle all messages.

        for_s    duration in seconds; None: no limit.
        idle     called every REDRAW_S.
        stopped  called if stop() ended the measurement.
        """
        self._until(None if for_s is None else self.line() + for_s, idle, is_sending=True)
        if self.is_ending:
            stopped()
        self.is_ending = True
        if (prober := self.prober) is not None:
            watch = next(one for one in self.watches if one.name == prober.name)
            self.wait(lambda: watch.own.is_over(prober.count))
        self.end(idle)

    def stop(self) -> None:
        """End the measurement; a second call also ends the wait for messages under way.

        Safe to call in a signal handler.
        """
        self.is_cut = self.is_ending
        self.is_ending = True

    @property
    def longest_end_s(self) -> float:
        """Longest wait in seconds for messages under way."""
        return CONFIRM_S + 2 * self.meter.grace_s + (0.0 if self.prober is None else CONFIRMS_S)

    def end(self, idle: Callable[[], None] = lambda: None) -> None:
        """Wait for messages under way and settle them; messages sent from now on are not measured."""
        self.ended_s = self.line()
        self._until(self.ended_s + CONFIRM_S, idle, is_sending=False)
        for watch in self.watches:
            watch.end()
        self._until(self.line() + 2 * self.meter.grace_s, idle, is_sending=False)
        if not self.is_cut:
            self.meter.finish()

    def serve(self, for_s: float) -> None:
        """Process reports for some seconds, for callers that send messages themselves."""
        self.take()
        self._until(self.line() + for_s, lambda: None, is_sending=True)

    def wait_for(self, station: str, count: int, within_s: float = CONFIRMS_S) -> None:
        """Wait until a station has reported the outcome of `count` messages, at most within_s."""
        self.wait(lambda: self.meter.inside.told(station) >= count, within_s)

    def wait(self, is_over: Callable[[], bool], within_s: float = CONFIRMS_S) -> None:
        """Process reports until is_over() returns True, at most within_s."""
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
        """Process the reports that have arrived, and settle messages every LOOK_S."""
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
