"""Sends probes to a station at a pace, and reflects those of others."""

import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import NamedTuple

import zmq

from board.errors import StationError
from firmware.meter.event import PROBES
from firmware.meter.probe import Probes
from firmware.meter.sample import Sample
from firmware.meter.watch import LABEL
from firmware.report import digest_of
from firmware.user import client
from firmware.user.received import Message

# Of which the way from user to user is measured: a minute at 1,000 a second.
MOST_OPEN = 65_536
# A sender that was late may make up for so much; more would be a burst.
CATCH_UP_S = 0.05
# One that comes again so much later is no echo of itself any more.
ECHO_S = 60.0


class Trip(NamedTuple):
    """From which station's user to which station's."""

    sender: str
    receiver: str


class Prober:
    """Gives probes to one station.

    rate   a second. most: so many in all, None: no end.
    trips_us  from handing a probe to the station here, to having it here from each station's 5556: one clock.
    """

    def __init__(
        self,
        name: str,
        context: client.Context,
        place: client.Address,
        probes: Probes,
        *,
        rate: float,
        most: int | None,
        options: Mapping[str, object],
    ) -> None:
        self.name = name
        self.probes = probes
        self.rate = rate
        self.count = 0
        self.trips_us: dict[Trip, Sample] = {}
        self._pusher = client.push(context, place)
        self._options = dict(options)
        self._most = most
        self._due_s: float | None = None
        self._open: OrderedDict[str, tuple[int, set[str]]] = OrderedDict()  # when, and who has had it

    @property
    def is_over(self) -> bool:
        return self._most is not None and self.count >= self._most

    def due_s(self, now_s: float) -> float:
        """Seconds until the next one; 0 where it should be gone."""
        if self._due_s is None:
            self._due_s = now_s
        return max(0.0, self._due_s - now_s)

    def send(self, now_s: float, now_ns: Callable[[], int]) -> None:
        """The next one. Raises StationError when the station takes nothing more."""
        pdu = self.probes.next()
        if not self._pusher.poll(round(client.ANSWER_S * 1000), zmq.POLLOUT):
            raise StationError(f"station {self.name} takes no more after {self.count} probes", "see `captain status`")
        self.count += 1
        wishes = json.dumps({**self._options, "label": f"{LABEL}/{self.count}"}).encode()
        self._open[digest_of(pdu)] = now_ns(), set()
        if len(self._open) > MOST_OPEN:
            self._open.popitem(last=False)
        self._pusher.send_multipart([b"v2x.%s." % self.probes.kind.encode(), pdu, wishes], zmq.DONTWAIT)
        due_s = (self._due_s if self._due_s is not None else now_s) + 1.0 / self.rate
        self._due_s = max(due_s, now_s - CATCH_UP_S)

    def delivered(self, station: str, digest: str, now_ns: int) -> None:
        """A user of a station has had a message: a probe for the first time, or another, or none."""
        began_ns, had = self._open.get(digest, (0, {station}))
        if station not in had:
            had.add(station)
            self.trips_us.setdefault(Trip(self.name, station), Sample()).add((now_ns - began_ns) / 1000)


class Reflector:
    """Sends back each probe that comes, once, and not one bit of it changed.

    reflected  how many; not_reflected: that the station did not take; stay_us: for how long each was here, from 5556 to
               5557.
    """

    def __init__(self, context: client.Context, place: client.Address, options: Mapping[str, object]) -> None:
        self.reflected = self.not_reflected = 0
        self.stay_us = Sample()
        self._pusher = client.push(context, place)
        self._options = dict(options)
        self._seen: OrderedDict[str, int] = OrderedDict()  # when, monotonic ns

    def take(self, message: Message, came_ns: int, now_ns: Callable[[], int]) -> None:
        """A message of 5556; one that has been here, be it back from another reflector, is let go."""
        if message.station_id != PROBES:
            return
        while self._seen and came_ns - next(iter(self._seen.values())) > ECHO_S * 1e9:
            self._seen.popitem(last=False)
        digest = digest_of(message.pdu)
        if digest in self._seen:
            return
        self._seen[digest] = came_ns
        if not self._pusher.poll(0, zmq.POLLOUT):
            self.not_reflected += 1
            return
        wishes = json.dumps({**self._options, "label": f"{LABEL}/back"}).encode()
        self._pusher.send_multipart([b"v2x.%s." % message.type.encode(), message.pdu, wishes], zmq.DONTWAIT)
        self.reflected += 1
        self.stay_us.add((now_ns() - came_ns) / 1000)
