"""Sending: sends messages to PULL at a pace and receives their confirms.

Pace, window and flights are the command's own. It reports unreadable reports and the times of each interface, which the
requests of captain_client do not keep.
"""

import json
import math
import time
from collections.abc import Callable, Iterable, Mapping

import zmq

from board.runtime.errors import StationError
from firmware.client import client
from firmware.client.sending.flights import Flight, Flights
from firmware.client.sending.payload import Payload

# Limit of unconfirmed messages when sending without a pace: a fraction of an interface's queue, so that none overflows.
WINDOW = 32
# A sender that is late may catch up by this much; more would be a burst.
CATCH_UP_S = 0.01


def confirms(context: client.Context, place: client.Address) -> client.Socket:
    """Return a subscription to confirms that is already in effect.

    A status over the same connection proves it. Raises StationError if no status comes within ANSWER_S.
    """
    subscriber = client.subscribe(context, place, place.report, "confirm.", "status.")
    if client.next_report(subscriber, "status.") is None:
        raise StationError(
            f"{place.host}:{place.report}: no status within {client.ANSWER_S:g} s",
            "name the report port of the station with --report PORT, or use --no-confirm",
        )
    subscriber.setsockopt(zmq.UNSUBSCRIBE, b"status.")
    return subscriber


class Sending:
    """Messages to one station, with a pace and confirms.

    pusher    PUSH socket connected to the station's PULL socket.
    confirms  subscription to the station's confirms; None: do not wait for confirms.
    label     prefix of all labels; each message adds its number.
    options   options of all messages (third frame), without the label.
    interval  seconds between two messages; 0: as fast as WINDOW unconfirmed messages allow.
    on_over   called with each completed flight.
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
        """Whether at least one interface sent each message; True if confirms are not awaited."""
        return self.count > 0 and (self._confirms is None or self.flights.outcomes["sent"] == self.count)

    def send(self, payloads: Iterable[Payload], kind: str | None = None) -> Iterable[int]:
        """Send each message when it is due, and yield the number sent so far.

        kind  message type that overrides the type of each payload; None: keep it.

        Raises StationError if the station stops accepting or confirming messages.
        """
        for one in payloads:
            self._hear_until_due()
            self.depart(one, one.type if kind is None else kind)
            self._due = max(self._due + self._interval, time.monotonic() - CATCH_UP_S)
            yield self.count

    def wait(self, longest: float) -> None:
        """Receive confirms until all messages are confirmed, at most for this many seconds."""
        until = time.monotonic() + longest
        while self._confirms is not None and self.flights.open and time.monotonic() < until:
            self.hear(until)

    def give_up(self) -> None:
        """Complete all remaining flights as unconfirmed."""
        for label in list(self.flights.open):
            self._on_over(self.flights.give_up(label))

    def depart(self, one: Payload, kind: str, more: Mapping[str, object] | None = None) -> None:
        """Send one message at once.

        kind  message type; empty: the station classifies the PDU.
        more  options of this message only.

        Raises StationError if the station does not accept it.
        """
        if not self._pusher.poll(round(client.ANSWER_S * 1000), zmq.POLLOUT):
            raise StationError(
                f"the station accepts no more messages after {self.count} messages", "see `captain status`"
            )
        self.count += 1
        label = f"{self._label}/{self.count}"
        envelope = f"v2x.{kind}." if kind else "v2x."
        options = {**self._options, **(more or {}), "label": label}
        is_json = one.form != "octets"
        if is_json:
            options = {"form": one.form, **options}
        frames = [envelope.encode(), one.pdu, json.dumps(options).encode()]
        # The flight is recorded before sending, because a signal may end the command at any time.
        lost = None if self._confirms is None else self.flights.depart(label, one.origin, len(one.pdu), is_json)
        self._pusher.send_multipart(frames, zmq.DONTWAIT)
        if lost is not None:
            self._on_over(lost)

    def _hear_until_due(self) -> None:
        """Receive confirms until the next message is due; without a pace, until the window has room."""
        while self._interval and time.monotonic() < self._due:
            self.hear(self._due)
        if not self._interval:
            self.make_room()

    def make_room(self) -> None:
        """Wait until fewer than WINDOW messages are unconfirmed.

        Raises StationError if no room appears within ANSWER_S.
        """
        until = time.monotonic() + client.ANSWER_S
        while self._confirms is not None and len(self.flights.open) >= WINDOW:
            self.hear(until)
            if time.monotonic() > until:
                raise StationError(
                    f"no confirm came for {len(self.flights.open)} messages within {client.ANSWER_S:g} s",
                    "see `captain status`; --no-confirm does not wait",
                )

    def hear(self, until: float) -> None:
        """Process confirms that have arrived, or wait for the next ones until a monotonic time in seconds."""
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
