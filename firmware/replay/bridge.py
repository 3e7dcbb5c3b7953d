"""Bridge over an emulated lossy link: passes frames between two sides in both directions."""

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from math import ceil
from typing import NamedTuple

import zmq

from board.runtime.errors import RequestError
from drivers.wire.impairment import Impairment
from firmware.codec.reading import Pdu
from firmware.replay.ears import Ear
from firmware.replay.ends import End
from firmware.replay.reasons import count

LONGEST_WAIT_S = 0.2  # longest wait until a signal is handled


class Side(NamedTuple):
    """One side of the bridge.

    name  name as the user wrote it.
    ear   receiving end.
    end   sending end.
    """

    name: str
    ear: Ear
    end: End


@dataclass
class Way:
    """One direction of the bridge, with its lossy link and its counts."""

    source: Side
    to: Side
    impairment: Impairment[Pdu]
    heard: int = 0
    sent: int = 0
    left_out: Counter[str] = field(default_factory=Counter)

    def take(self, now: float) -> int:
        """Receive messages from the source and put them on the lossy link; return their number."""
        before = self.heard
        for one in self.source.ear.hear():
            self.heard += 1
            try:
                octets = self.to.end.octets(one)
            except RequestError as error:
                self._leave_out(error, one)
            else:
                self.impairment.take(octets, now, one)
        return self.heard - before

    def give(self, now: float) -> None:
        """Send the messages that are due at the end of the lossy link."""
        for octets, one in self.impairment.due(now):
            try:
                self.to.end.send(octets, one)
            except RequestError as error:
                self._leave_out(error, one)
            else:
                self.sent += 1

    def _leave_out(self, error: RequestError, one: Pdu) -> None:
        count(self.left_out, error.message.removeprefix(f"{one.origin}: "))


class Bridge:
    """Serves both directions of a bridge in one thread."""

    def __init__(self, ways: list[Way], clock: Callable[[], float] = time.monotonic) -> None:
        self._ways = ways
        self._clock = clock
        self._is_stopped = False
        self._poller = zmq.Poller()
        for way in ways:
            self._poller.register(way.source.ear.polled, zmq.POLLIN)

    def run(self, duration: float | None) -> None:
        """Pass messages for `duration` seconds and then until all delayed ones are sent; None: until stop()."""
        end = None if duration is None else self._clock() + duration
        while not self._is_stopped and (end is None or self._clock() < end):
            self._turn(end)
        while not self._is_stopped and any(way.impairment.waiting for way in self._ways):
            self._turn(None, is_taking=False)

    def stop(self) -> None:
        """End between two turns; delayed messages are not sent. Safe to call in a signal handler."""
        self._is_stopped = True

    def _turn(self, end: float | None, is_taking: bool = True) -> None:
        now = self._clock()
        # The descriptor of a SUB socket signals only new arrivals. Waiting messages are therefore taken before polling.
        taken = sum(way.take(now) for way in self._ways) if is_taking else 0
        for way in self._ways:
            way.give(self._clock())
        if not taken:
            self._wait(end, is_taking)

    def _wait(self, end: float | None, is_taking: bool) -> None:
        until = [due for way in self._ways if (due := way.impairment.deadline()) is not None]
        if end is not None:
            until.append(end)
        left = min([LONGEST_WAIT_S, *(max(0.0, when - self._clock()) for when in until)])
        # This is the command's own process. sleep() serves if nothing is received, and for times below the 1 ms
        # resolution of zmq's poll().
        if not is_taking or left < 0.001:
            time.sleep(left)
        else:
            self._poller.poll(ceil(left * 1000) - 1)
