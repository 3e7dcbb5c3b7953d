"""What a station alone shows: how long messages wait and take to leave, what it hears, and how long users wait."""

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

from firmware.meter.age import Gaps
from firmware.meter.event import Received, Sent
from firmware.meter.figures import MOST_OF_ROW, MOST_ROWS, OTHERS
from firmware.meter.sample import Sample


class Port(NamedTuple):
    """An interface of a station."""

    station: str
    interface: str


class Leaving:
    """What an interface sent, and what it or the station did not: counted by reason."""

    def __init__(self) -> None:
        self.sent = 0
        self.not_sent: Counter[str] = Counter()
        self.queue_us, self.send_us = Sample(), Sample()


class Source(NamedTuple):
    """Whose messages an interface hears, and of which type."""

    station: str
    interface: str
    type: str
    station_id: int | None


class Hearing:
    """What an interface heard of one source."""

    def __init__(self) -> None:
        self.received = 0
        self.gaps = Gaps(MOST_OF_ROW)
        self.rssi_dbm = Sample(MOST_OF_ROW)


class Delivery:
    """What a station gave to its users on 5556: up_us from the reception to here, by one clock."""

    def __init__(self) -> None:
        self.types: Counter[str] = Counter()
        self.up_us = Sample()


class Inside:
    """All stations, each by itself."""

    def __init__(self) -> None:
        self.leaving: dict[Port, Leaving] = {}
        self.delivered: dict[str, Delivery] = {}
        self._hearing: dict[Source, Hearing] = {}  # of the first; others are together in one of their interface

    def sent(self, event: Sent) -> None:
        one = self.leaving.setdefault(Port(event.station, event.interface), Leaving())
        one.sent += 1
        one.queue_us.add(event.queue_ns / 1000)
        one.send_us.add(event.send_ns / 1000)

    def not_sent(self, station: str, interface: str, reason: str) -> None:
        self.leaving.setdefault(Port(station, interface), Leaving()).not_sent[reason] += 1

    def told(self, station: str) -> int:
        """Of how many messages it is known what a station did with them; each interface counts."""
        return sum(one.sent + one.not_sent.total() for port, one in self.leaving.items() if port.station == station)

    def received(self, event: Received) -> None:
        key = Source(event.station, event.interface, event.what.type, event.what.station_id)
        if key not in self._hearing and len(self._hearing) >= MOST_ROWS:
            key = Source(event.station, event.interface, OTHERS, None)
        hearing = self._hearing.get(key)
        if hearing is None:
            hearing = self._hearing[key] = Hearing()
        hearing.received += 1
        hearing.gaps.add(event.received_ns)
        if event.rssi_dbm is not None:
            hearing.rssi_dbm.add(event.rssi_dbm)

    def to_user(self, station: str, kind: str, received_ns: int | None, delivered_ns: int | None) -> None:
        """A PDU on 5556; delivered_ns: by the clock that received_ns is of, None where the meter has another one."""
        one = self.delivered.setdefault(station, Delivery())
        one.types[kind] += 1
        if received_ns and delivered_ns is not None:
            one.up_us.add((delivered_ns - received_ns) / 1000)

    def hearing(self) -> Iterator[tuple[Source, Hearing]]:
        yield from sorted(self._hearing.items(), key=lambda item: (*item[0][:3], item[0].station_id or 0))
