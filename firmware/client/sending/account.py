"""Account of sent messages: prints their outcomes and the counts."""

import json
import sys
from collections import Counter
from collections.abc import Iterable, Iterator

from firmware.client.sending.flights import Flight, Flights
from firmware.client.sending.payload import Item, Payload
from firmware.client.sending.sending import Sending
from firmware.client.show.failures import TOLD, Failures
from firmware.client.show.table import Table, lines_for
from firmware.printable import clean, failure_record, folded


class Account:
    """Report of sent messages: each finished message, and the counts at the end.

    is_brief  omit messages that were sent; report at most three unsent ones of each kind.
    invalid   number of invalid messages, which are not given to the station.
    failures  reports the invalid messages.
    """

    def __init__(self, is_json: bool) -> None:
        self.is_brief = True
        self.invalid = 0
        self.failures = Failures()
        self._is_json = is_json
        self._told: Counter[tuple[tuple[str, str, str], ...]] = Counter()

    def valid(self, items: Iterable[Item]) -> Iterator[Payload]:
        """Yield the valid messages; report and count the invalid ones."""
        for item in items:
            if isinstance(item, Payload):
                yield item
                continue
            self.invalid += 1
            self.failures.report(item)
            if self._is_json:
                print(json.dumps({"outcome": "invalid", **failure_record(item)}), flush=True)

    def one(self, flight: Flight) -> None:
        if self._is_json:
            print(json.dumps(record(flight)), flush=True)
        elif not self.is_brief or self._is_new(flight):
            line = clean(f"{flight.origin}: {_described(flight)}: {fate(flight)}")
            print(folded(line, sys.stdout), flush=True)

    def all(self, outgoing: Sending) -> None:
        """Print the number of messages by outcome, and a table by interface with times in microseconds."""
        flights = outgoing.flights
        outcomes = ", ".join(f"{count} {outcome}" for outcome, count in sorted(flights.outcomes.items()))
        title = f"{outgoing.count} given to the station" + (f": {outcomes}" if outcomes else "")
        title += f"; {self.invalid} invalid, not sent" if self.invalid else ""
        meanings = {reason: meaning for _, _, reason, meaning in flights.hops if reason}
        notes = [f"{reason}: {meaning}" for reason, meaning in sorted(meanings.items())]
        if flights.rubbish:
            notes.append(f"{flights.rubbish} unreadable reports")
        stream = sys.stderr if self._is_json else sys.stdout
        rows = [_summed(flights, hop, count) for hop, count in sorted(flights.hops.items())]
        print("\n".join(lines_for(Table(title, SUMMED, rows, notes), stream)), file=stream, flush=True)

    def unsent(self, outgoing: Sending) -> int:
        """Return the number of messages that were invalid, or that no interface sent."""
        sent = outgoing.count if outgoing.all_sent else outgoing.flights.outcomes["sent"]
        return self.invalid + outgoing.count - sent

    def _is_new(self, flight: Flight) -> bool:
        """Whether to report an unsent message: at most three of each kind are. The table at the end counts all."""
        if flight.outcome == "sent":
            return False
        kind = tuple((hop.interface, hop.outcome, hop.reason) for hop in flight.hops)
        self._told[kind] += 1
        return self._told[kind] <= TOLD


SUMMED = ("interface", "outcome", ">count", ">queue us", ">longest", ">send us", ">longest", "reason")


def _summed(flights: Flights, hop: tuple[str, str, str, str], count: int) -> tuple[str, ...]:
    interface, outcome, reason, _ = hop
    times = flights.times.get(interface) if outcome == "sent" else None
    if times is None:
        numbers = ("", "", "", "")
    else:
        numbers = (
            f"{times.queue_us / count:.0f}",
            f"{times.queue_longest_us:.0f}",
            f"{times.send_us / count:.0f}",
            f"{times.send_longest_us:.0f}",
        )
    return (interface or "(station)", outcome, str(count), *numbers, reason)


def _described(flight: Flight) -> str:
    octets = f"{flight.octets} octets of JSON" if flight.is_json else f"{flight.octets} octets"
    return f"{flight.type} {octets}" if flight.type else octets


def fate(flight: Flight) -> str:
    """Return the outcome of one message as text, by interface."""
    parts = []
    for hop in flight.hops:
        by = f" by {hop.interface}" if hop.interface else ""
        if hop.outcome == "sent":
            parts.append(f"sent{by}, {hop.queue_us:.0f} us queued, {hop.send_us:.0f} us to send")
        else:
            parts.append(f"{hop.outcome}{by}: {hop.reason} ({hop.detail or hop.meaning})")
    silent = sorted((flight.expected or set()) - {hop.interface for hop in flight.hops})
    if flight.expected is None and not parts:
        parts.append("no confirm came")
    parts += [f"no confirm from {name}" for name in silent]
    return "; ".join(parts) or "accepted, but for no interface"


def record(flight: Flight) -> dict[str, object]:
    """Return the outcome of one message as an object for --json."""
    return {
        "label": flight.label,
        "origin": flight.origin,
        "type": flight.type,
        "octets": flight.octets,
        "outcome": flight.outcome,
        "hops": [hop._asdict() for hop in flight.hops],
    }
