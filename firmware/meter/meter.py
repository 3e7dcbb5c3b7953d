"""Meter: computes figures from reports of stations, without sockets and clocks."""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from firmware.meter.event import PROBES, ReceivedEvent, Sent
from firmware.meter.fate import Settled, Way
from firmware.meter.figures import Figures, Rows
from firmware.meter.inside import Inside
from firmware.meter.matching import GRACE_S, Matching
from firmware.meter.paths import Paths
from firmware.meter.report.spots import Spots
from firmware.meter.window import Windows


class Ends(NamedTuple):
    """Two interfaces that hear each other, as named by the user: A:g5=B:air."""

    one: tuple[str, str]
    other: tuple[str, str]


class Measured:
    """Figures of one direction: of the whole measurement, and by intervals."""

    def __init__(self, interval_s: float) -> None:
        self.whole = Figures()
        self.windows = Windows(interval_s)


class Meter:
    """All directions between the measured stations.

    interval_s   averaging interval T in seconds.
    grace_s      seconds to wait for the report of one end after that of the other.
    named        interfaces that hear each other, if neither name nor technology shows it.
    round_trips_of  station whose probes are reflected: its round trips are measured as well; empty: none.
    """

    def __init__(
        self, interval_s: float = 1.0, grace_s: float = GRACE_S, named: Iterable[Ends] = (), round_trips_of: str = ""
    ) -> None:
        self.interval_s = interval_s
        self.grace_s = grace_s
        self.ways: dict[Way, Measured] = {}
        self.rows = Rows()
        self.inside = Inside()
        self.paths = Paths(3 * grace_s)
        self.spots = Spots()
        named = list(named)
        self._named = [(ends.one, ends.other) for ends in named] + [(ends.other, ends.one) for ends in named]
        self._round_trips_of = round_trips_of
        self._stations: dict[str, Mapping[str, str]] = {}
        self._matching: dict[Way, Matching] = {}
        self._from: dict[tuple[str, str], list[Matching]] = {}
        self._into: dict[tuple[str, str], list[Matching]] = {}

    @property
    def stations(self) -> list[str]:
        return list(self._stations)

    def strangers(self) -> list[str]:
        """Return the interfaces named by the user that no station has."""
        ends = {end for pair in self._named for end in pair}
        return sorted(":".join(end) for end in ends if end[1] not in self._stations.get(end[0], {}))

    def station(self, name: str, interfaces: Mapping[str, str]) -> None:
        """Add a station, or update it after a change of its interfaces.

        interfaces  technology of each interface; empty if unknown.

        To be called before its first event.
        """
        if self._stations.get(name) == interfaces:
            return
        self._stations[name] = dict(interfaces)
        self._from.clear()
        self._into.clear()
        for way in self._possible():
            matching = self._matching.get(way)
            if matching is None:
                matching = self._matching[way] = Matching(way, self.grace_s)
                self.ways[way] = Measured(self.interval_s)
            self._from.setdefault((way.sender, way.out), []).append(matching)
            self._into.setdefault((way.receiver, way.into), []).append(matching)

    def hears(self, station: str, since_s: float) -> None:
        """Note the time from which the sending reports of a station are received; it may have sent messages before."""
        for matching in self._matching.values():
            if matching.way.sender == station:
                matching.since_s = since_s

    def silent(self, station: str, since_s: float, until_s: float = math.inf) -> None:
        """Note that sending reports of a station may be missing between two times."""
        for matching in self._matching.values():
            if matching.way.sender == station:
                matching.silent(since_s, until_s)

    def sent(self, event: Sent) -> None:
        self.inside.sent(event)
        for matching in self._from.get((event.station, event.interface), ()):
            if not matching.way.is_round_trip or event.is_probe:
                matching.sent(event)

    def received(self, event: ReceivedEvent) -> None:
        self.inside.received(event)
        for matching in self._into.get((event.station, event.interface), ()):
            if not matching.way.is_round_trip or event.what.station_id == PROBES:
                matching.received(event)

    def unheard(self, receiver: str, count: float, since_s: float, until_s: float) -> None:
        """Note that indications of a station were missed between two times.

        count  number of missed indications; math.inf: unknown. Then the station's sending reports are uncertain as
               well.
        """
        for matching in self._matching.values():
            if matching.way.receiver == receiver:
                matching.unheard(count, since_s, until_s)
            elif matching.way.sender == receiver and count == math.inf:
                matching.unheard(count, until_s, until_s)
                matching.silent(since_s, until_s)

    def settle(self, now_s: float) -> list[Settled]:
        """Add the fates that are known by now to the figures, and return them; now_s: math.inf to settle all."""
        settled = [one for matching in self._matching.values() for one in matching.settle(now_s)]
        for one in settled:
            measured = self.ways[one.way]
            measured.whole.add(one)
            measured.windows.add(one)
            self.rows.add(one)
            self.spots.add(one)
            self.paths.add(one, now_s)
        self.paths.settle(now_s)
        return settled

    def finish(self) -> list[Settled]:
        """Settle all messages, because no further report will come."""
        return self.settle(math.inf)

    @property
    def lost(self) -> int:
        return sum(one.whole.lost for way, one in self.ways.items() if not way.is_round_trip)

    @property
    def sent_count(self) -> int:
        return sum(one.whole.sent for way, one in self.ways.items() if not way.is_round_trip)

    @property
    def arrived(self) -> int:
        return sum(one.whole.arrived for way, one in self.ways.items() if not way.is_round_trip)

    def _possible(self) -> Iterator[Way]:
        for station, interfaces in self._stations.items():
            for interface in interfaces:
                for other in self._stations:
                    if other == station:
                        if station == self._round_trips_of:
                            yield Way(station, interface, station, interface)
                    elif into := self._counterpart(station, interface, other):
                        yield Way(station, interface, other, into)

    def _counterpart(self, station: str, interface: str, other: str) -> str:
        """Return the interface of another station that hears this one; empty if none is known.

        Named pairs come first, then interfaces of the same name unless technologies differ, then the only interface of
        the same technology.
        """
        for one, end in self._named:
            if one == (station, interface) and end[0] == other:
                return end[1]
        technology = self._stations[station].get(interface, "")
        theirs = self._stations[other]
        if interface in theirs and (not technology or not theirs[interface] or theirs[interface] == technology):
            return interface
        alike = [name for name, one in theirs.items() if one == technology]
        return alike[0] if technology and len(alike) == 1 else ""
