"""Flights: messages given to the station, until its confirms complete them."""

from collections import Counter
from collections.abc import Mapping
from typing import NamedTuple

from firmware.untrusted import number, text, texts

# Limit of unconfirmed messages, far above what a station confirms in a second. Beyond it the oldest message counts as
# unconfirmed for good.
MAX_OPEN = 10_000


class Hop(NamedTuple):
    """Outcome of a message at one interface, or at the station itself."""

    interface: str  # empty for the station itself
    outcome: str  # sent, dropped or refused
    reason: str = ""
    meaning: str = ""
    detail: str = ""
    queue_us: float = 0.0
    send_us: float = 0.0


class Times:
    """Sums and maxima of queueing and sending time in one interface's confirms, in microseconds."""

    __slots__ = ("queue_longest_us", "queue_us", "send_longest_us", "send_us")

    def __init__(self) -> None:
        self.queue_us = self.queue_longest_us = self.send_us = self.send_longest_us = 0.0

    def add(self, hop: Hop) -> None:
        self.queue_us += hop.queue_us
        self.queue_longest_us = max(self.queue_longest_us, hop.queue_us)
        self.send_us += hop.send_us
        self.send_longest_us = max(self.send_longest_us, hop.send_us)


class Flight:
    """One message given to the station, with the confirms received for it.

    octets   length of the PDU; with is_json that of the JSON object.
    is_json  the message is JSON, and no confirm has told the length of its PDU.
    """

    __slots__ = ("expected", "hops", "is_json", "label", "octets", "origin", "type")

    def __init__(self, label: str, origin: str, octets: int, is_json: bool = False) -> None:
        self.label = label
        self.origin = origin
        self.octets = octets
        self.is_json = is_json
        self.type = ""
        # Interfaces that must confirm the message; None until the station has accepted or refused it.
        self.expected: set[str] | None = None
        self.hops: list[Hop] = []

    @property
    def is_over(self) -> bool:
        return self.expected is not None and self.expected <= {hop.interface for hop in self.hops}

    @property
    def outcome(self) -> str:
        """`sent` if one interface sent it.

        Otherwise the outcome at the last interface or the station, or `unconfirmed`.
        """
        if any(hop.outcome == "sent" for hop in self.hops):
            return "sent"
        return self.hops[-1].outcome if self.is_over and self.hops else "unconfirmed"


class Flights:
    """Unconfirmed messages of one `captain send` by label, and counts of the completed ones."""

    def __init__(self, most: int = MAX_OPEN) -> None:
        self.open: dict[str, Flight] = {}
        self.outcomes: Counter[str] = Counter()
        self.hops: Counter[tuple[str, str, str, str]] = Counter()  # count by interface, outcome, reason, meaning
        self.times: dict[str, Times] = {}  # times of sent messages by interface
        self.rubbish = 0
        self._most = most

    def depart(self, label: str, origin: str, octets: int, is_json: bool = False) -> Flight | None:
        """Add a message that was given to the station. Beyond the limit, return the oldest flight as unconfirmed."""
        self.open[label] = Flight(label, origin, octets, is_json)
        return self.give_up(next(iter(self.open))) if len(self.open) > self._most else None

    def feed(self, confirm: Mapping[str, object]) -> Flight | None:
        """Take a confirm, and return the flight if this completes it. Confirms of other users are ignored."""
        flight = self.open.get(text(confirm, "label"))
        if flight is None:
            return None
        outcome = text(confirm, "outcome")
        if outcome not in ("accepted", "sent", "refused", "dropped"):
            self.rubbish += 1
            return None
        flight.type = text(confirm, "type")
        if outcome == "accepted":
            flight.expected = set(texts(confirm, "interfaces"))
            if flight.is_json and (octets := round(number(confirm, "octets"))):
                flight.octets, flight.is_json = octets, False
        else:
            self._land(flight, outcome, confirm)
        return self.give_up(flight.label) if flight.is_over else None

    def give_up(self, label: str) -> Flight:
        """Remove a flight, complete or not, count its outcome, and return it."""
        flight = self.open.pop(label)
        self.outcomes[flight.outcome] += 1
        return flight

    def _land(self, flight: Flight, outcome: str, confirm: Mapping[str, object]) -> None:
        interface = text(confirm, "interface")
        words = (text(confirm, "reason"), text(confirm, "meaning"), text(confirm, "detail"))
        hop = Hop(interface, outcome, *words, number(confirm, "queue_us"), number(confirm, "send_us"))
        flight.hops.append(hop)
        self.hops[hop[:4]] += 1
        if outcome == "refused":
            flight.expected = set()
        elif outcome == "sent":
            self.times.setdefault(interface, Times()).add(hop)
