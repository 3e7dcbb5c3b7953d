"""Sends messages to a station over PULL at a pace, and hears the confirms about them over the report port."""

import json
import math
import time
from collections.abc import Callable, Iterable, Mapping

import zmq

from board.errors import StationError
from firmware.user import client
from firmware.user.flights import Flight, Flights
from firmware.user.payload import Payload

# Without a pace so many are on their way at once: a fraction of an interface's queue, so that none is full.
WINDOW = 32
# A sender that was late may make up for this much; more would be a burst.
CATCH_UP_S = 0.01


def confirms(context: client.Context, place: client.Address) -> client.Socket:
    """A subscription to confirms that the station knows of: it has sent a status over the same connection.

    Raises StationError when nobody answers in time.
    """
    subscriber = client.subscribe(context, place, place.report, "confirm.", "status.")
    if client.next_report(subscriber, "status.") is None:
        raise StationError(
            f"what listens at {place.host}:{place.report} sent no status within {client.ANSWER_S:g} s",
            "is that a station's report port? name it with --report PORT, or do without: --no-confirm",
        )
    subscriber.setsockopt(zmq.UNSUBSCRIBE, b"status.")
    return subscriber


class Sending:
    """Messages to one station.

    pusher    connected to the station's PULL.
    confirms  subscribed to the station's confirms; None where nobody wants to know.
    label     of all messages; each adds its number.
    options   of all messages: the third frame, without the label.
    interval  seconds between two messages; 0 keeps WINDOW of them on their way.
    on_over   hears of each flight that is over.
    """

    def __init__(
        self,
        pusher: client.Socket,
        confirms: client.Socket | None,
        *,
        label: str,
        options: Mapping[str, object],
        interval: float,
        on_over: Callable[[Flight], None],
    ) -> None:
        self.flights = Flights()
        self.count = 0
        self._pusher = pusher
        self._confirms = confirms
        self._label = label
        self._options = dict(options)
        self._interval = interval
        self._on_over = on_over
        self._due = time.monotonic()

    @property
    def all_sent(self) -> bool:
        """Whether each message was sent by at least one interface, as far as confirms were wanted."""
        return self.count > 0 and (self._confirms is None or self.flights.outcomes["sent"] == self.count)

    def send(self, payloads: Iterable[Payload], kind: str | None = None) -> Iterable[int]:
        """Send each when its time has come, and yield how many were sent; kind replaces their own types.

        Raises StationError when the station takes or confirms nothing any more.
        """
        for one in payloads:
            self._hear_until_due()
            self.depart(one, one.type if kind is None else kind)
            self._due = max(self._due + self._interval, time.monotonic() - CATCH_UP_S)
            yield self.count

    def wait(self, longest: float) -> None:
        """Hear confirms until all are in or so many seconds are over."""
        until = time.monotonic() + longest
        while self._confirms is not None and self.flights.open and time.monotonic() < until:
            self.hear(until)

    def give_up(self) -> None:
        """What is not confirmed by now stays so."""
        for label in list(self.flights.open):
            self._on_over(self.flights.give_up(label))

    def depart(self, one: Payload, kind: str, more: Mapping[str, object] | None = None) -> None:
        """Send one at once; more are options of this one. Raises StationError when the station takes none."""
        if not self._pusher.poll(round(client.ANSWER_S * 1000), zmq.POLLOUT):
            raise StationError(f"the station takes no more after {self.count} messages", "see `captain status`")
        self.count += 1
        label = f"{self._label}/{self.count}"
        envelope = f"v2x.{kind}." if kind else "v2x."
        frames = [envelope.encode(), one.pdu, json.dumps({**self._options, **(more or {}), "label": label}).encode()]
        # It is known before it goes: a signal may end this at any time.
        lost = None if self._confirms is None else self.flights.depart(label, one.origin, len(one.pdu))
        self._pusher.send_multipart(frames, zmq.DONTWAIT)
        if lost is not None:
            self._on_over(lost)

    def _hear_until_due(self) -> None:
        """Wait for the next message's time; or, without a pace, for a place in the window."""
        while self._interval and time.monotonic() < self._due:
            self.hear(self._due)
        if not self._interval:
            self.make_room()

    def make_room(self) -> None:
        """Wait until fewer than WINDOW are on their way. Raises StationError where none is confirmed any more."""
        until = time.monotonic() + client.ANSWER_S
        while self._confirms is not None and len(self.flights.open) >= WINDOW:
            self.hear(until)
            if time.monotonic() > until:
                raise StationError(
                    f"no confirm came for {len(self.flights.open)} messages within {client.ANSWER_S:g} s",
                    "see `captain status`; --no-confirm does not wait",
                )

    def hear(self, until: float) -> None:
        """Take the confirms that have come, or wait for some until then."""
        left = max(0.0, until - time.monotonic())
        if self._confirms is None:
            time.sleep(left)
        elif self._confirms.poll(math.ceil(left * 1000)):
            for frames in client.waiting(self._confirms):
                self._take(client.parse_report(frames))

    def _take(self, report: tuple[str, dict[str, object]] | None) -> None:
        if report is None:
            self.flights.rubbish += 1
        elif report[0].startswith("confirm."):
            over = self.flights.feed(report[1])
            if over is not None:
                self._on_over(over)
