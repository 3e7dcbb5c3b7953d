"""Measures inside a single station: queue, sending, reception, delivery to users."""

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from firmware.meter.age import Gaps
from firmware.meter.event import ReceivedEvent, Sent
from firmware.meter.figures import MOST_OF_ROW, MOST_ROWS, OTHERS
from firmware.meter.sample import Sample


class Port(NamedTuple):
    """Interface of a station."""

    station: str
    interface: str


class Leaving:
    """Messages that an interface sent, and those not sent by reason."""

    def __init__(self) -> None:
        self.sent = 0
        self.not_sent: Counter[str] = Counter()
        self.queue_us, self.send_us = Sample(), Sample()


class MeteredSource(NamedTuple):
    """Interface of a station with one source that it receives: type and stationID."""

    station: str
    interface: str
    type: str
    station_id: int | None


class Hearing:
    """Receptions of one source by an interface."""

    def __init__(self) -> None:
        self.received = 0
        self.gaps = Gaps(MOST_OF_ROW)
        self.rssi_dbm = Sample(MOST_OF_ROW)


class Delivery:
    """Messages that a station delivered to its users on port 5556.

    types  count by type.
    up_us  time from reception to arrival at the meter, by one clock.
    """

    def __init__(self) -> None:
        self.types: Counter[str] = Counter()
        self.up_us = Sample()


class Inside:
    """Measures inside of each station."""

    def __init__(self) -> None:
        self.leaving: dict[Port, Leaving] = {}
        self.delivered: dict[str, Delivery] = {}
        # Receptions by source; beyond MOST_ROWS, other sources of an interface share one entry.
        self._hearing: dict[MeteredSource, Hearing] = {}

    def sent(self, event: Sent) -> None:
        one = self.leaving.setdefault(Port(event.station, event.interface), Leaving())
        one.sent += 1
        one.queue_us.add(event.queue_ns / 1000)
        one.send_us.add(event.send_ns / 1000)

    def not_sent(self, station: str, interface: str, reason: str) -> None:
        self.leaving.setdefault(Port(station, interface), Leaving()).not_sent[reason] += 1

    def told(self, station: str) -> int:
        """Return the number of messages whose outcome a station has reported, counted at each interface."""
        return sum(one.sent + one.not_sent.total() for port, one in self.leaving.items() if port.station == station)

    def received(self, event: ReceivedEvent) -> None:
        key = MeteredSource(event.station, event.interface, event.what.type, event.what.station_id)
        if key not in self._hearing and len(self._hearing) >= MOST_ROWS:
            key = MeteredSource(event.station, event.interface, OTHERS, None)
        hearing = self._hearing.get(key)
        if hearing is None:
            hearing = self._hearing[key] = Hearing()
        hearing.received += 1
        hearing.gaps.add(event.received_ns)
        if event.rssi_dbm is not None:
            hearing.rssi_dbm.add(event.rssi_dbm)

    def to_user(self, station: str, kind: str, received_ns: int | None, delivered_ns: int | None) -> None:
        """Count a PDU received on port 5556.

        received_ns   time of its reception by the station's clock; None if unknown.
        delivered_ns  time of its arrival here by the same clock; None if the meter has another clock.
        """
        one = self.delivered.setdefault(station, Delivery())
        one.types[kind] += 1
        if received_ns and delivered_ns is not None:
            one.up_us.add((delivered_ns - received_ns) / 1000)

    def hearing(self) -> Iterator[tuple[MeteredSource, Hearing]]:
        yield from sorted(self._hearing.items(), key=lambda item: (*item[0][:3], item[0].station_id or 0))
