"""Tap: reads deliveries by a profile, and passes messages on."""

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NamedTuple

from board.runtime.errors import RequestError
from drivers.reason import Reason
from drivers.wire.v2n.message import Delivery, RefusedError
from drivers.wire.v2n.profile import Profile
from firmware.printable import folded
from firmware.tap.connection import Connection
from firmware.tap.counts import Counts, Taken
from firmware.tap.recording import Recording

INTERRUPTED = 130  # exit status after SIGINT, as in shells
TURN_S = 0.2  # seconds between two looks at the clock while nothing arrives


class TapFilter(NamedTuple):
    """Selection of messages, and when to end.

    types  types by name or messageID; empty: all.
    most   end after this number of messages; None: no limit.
    for_s  end after this time in seconds; None: no limit.
    """

    types: frozenset[str] = frozenset()
    most: int | None = None
    for_s: float | None = None


class Tap:
    """Converts deliveries of a broker to messages.

    show     called with each selected message, after it is recorded.
    is_copy  returns whether an unknown topic only carries copies of messages that another topic has.
    """

    def __init__(self, profile: Profile, wish: TapFilter, recording: Recording | None = None) -> None:
        self.counts = Counts()
        self.show: Callable[[Taken], object] = lambda message: None
        self.is_copy: Callable[[str], bool] = lambda topic: False
        self._profile = profile
        self._wish = wish
        self._recording = recording

    @property
    def is_done(self) -> bool:
        wish = self._wish
        is_late = wish.for_s is not None and time.monotonic() - self.counts.started >= wish.for_s
        return is_late or self.counts.total == wish.most

    def take(self, delivery: Delivery) -> None:
        """Read a delivery and pass its message on; count an unreadable one by its reason."""
        received_ns = time.time_ns()
        self.counts.octets += len(delivery.payload)
        try:
            pdu, port, source = self._profile.receive(delivery)
        except RefusedError as error:
            if error.reason is Reason.TOPIC and self.is_copy(delivery.topic):
                self.counts.copies += 1
            else:
                self.counts.refuse(error, delivery)
            return
        message = Taken(pdu, port, source, delivery.topic, received_ns)
        kind = message.type
        if self._wish.types and self._wish.types.isdisjoint((kind, str(pdu[1]))):
            self.counts.unwanted += 1
        elif self.counts.total == self._wish.most:
            self.counts.beyond += 1
        else:
            self.counts.add(kind)
            self._record(message)
            self.show(message)

    def idle(self) -> None:
        """Sync the recording when it is due. The caller calls it a few times a second."""
        if self._recording is not None:
            self._recording.idle()

    def _record(self, message: Taken) -> None:
        if self._recording is None:
            return
        try:
            self._recording.write(message)
        except RequestError as error:
            self.counts.unrecorded[f"{message.type}: {error.message}"[:120]] += 1


class Signals:
    """SIGINT and SIGTERM noted as flags, so that a tap leaves its broker before it ends."""

    def __init__(self) -> None:
        self.number = 0

    def note(self, number: int, frame: FrameType | None) -> None:
        if self.number:
            raise KeyboardInterrupt  # this is the second signal
        self.number = number

    @contextmanager
    def watched(self) -> Iterator[None]:
        before = {number: signal.signal(number, self.note) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, old in before.items():
                signal.signal(number, old)


def run(connection: Connection, tap: Tap, idle: Callable[[], None]) -> int:
    """Receive messages until a limit or a signal; then leave the broker. Returns the exit status."""
    signals = Signals()
    connection.open()
    with signals.watched():
        say(f"captain: {connection.broker}: subscribed")
        while not tap.is_done and not signals.number:
            connection.turn(TURN_S)
            tap.idle()
            idle()
        connection.leave()
    return INTERRUPTED if signals.number == signal.SIGINT else 0


def say(line: str) -> None:
    """Print one line on standard error, separate from messages on standard output."""
    print(folded(line, sys.stderr), file=sys.stderr, flush=True)
