"""A tap: takes deliveries of a broker, reads them by a profile, and gives messages to whoever shows or records them."""

import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NamedTuple

from board.errors import RequestError
from drivers.reason import Reason
from drivers.wire.v2n import Profile
from drivers.wire.v2n_message import Delivery, RefusedError
from firmware.tap.connection import Connection
from firmware.tap.counts import Counts, Taken
from firmware.tap.recording import Recording

INTERRUPTED = 130  # as a shell reports SIGINT
TURN_S = 0.2  # between two looks at the clock while nothing comes


class Wish(NamedTuple):
    """Which messages, by name or messageID, and until when; None or empty: all, for ever."""

    types: frozenset[str] = frozenset()
    most: int | None = None
    for_s: float | None = None


class Tap:
    """Deliveries in, messages out.

    show     is called with each message that is wanted, once it is recorded.
    is_copy  whether a topic that the profile does not know has only what comes by another one.
    """

    def __init__(self, profile: Profile, wish: Wish, recording: Recording | None = None) -> None:
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
        """Read a delivery and pass its message on; what cannot be read is counted by its reason."""
        received_ns = time.time_ns()
        self.counts.octets += len(delivery.payload)
        try:
            _check_topic(delivery.topic)
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
        """To be called some times a second: what is recorded is not left with the kernel."""
        if self._recording is not None:
            self._recording.idle()

    def _record(self, message: Taken) -> None:
        if self._recording is None:
            return
        try:
            self._recording.write(message)
        except RequestError as error:
            self.counts.unrecorded[f"{message.type}: {error.message}"[:120]] += 1


def _check_topic(topic: str) -> None:
    """Raises RefusedError where a broker has sent octets as a topic that are no UTF-8 (MQTT 5.0, 1.5.4)."""
    try:
        topic.encode()
    except UnicodeEncodeError:
        octets = topic.encode(errors="surrogateescape")[:64]
        raise RefusedError(Reason.TOPIC, f"topic {octets!r} is no UTF-8") from None


class Signals:
    """SIGINT and SIGTERM as flags: a tap leaves its broker before it ends."""

    def __init__(self) -> None:
        self.number = 0

    def note(self, number: int, frame: FrameType | None) -> None:
        if self.number:
            raise KeyboardInterrupt  # it was asked for twice
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
    """Take messages until the wish is fulfilled or a signal came; then leave the broker.

    Returns the exit status.
    """
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
    """One line to whoever watches, beside what goes to standard output."""
    print(line, file=sys.stderr, flush=True)
