"""Sends probes to a station at a pace; reflects probes of others."""

import json
from collections import OrderedDict
from collections.abc import Callable, Mapping
from typing import NamedTuple

import zmq

from board.runtime.errors import StationError
from firmware.client import client
from firmware.client.received import Message
from firmware.endpoint.report import digest_of
from firmware.meter.event import PROBES
from firmware.meter.probe import Probes
from firmware.meter.sample import Sample
from firmware.meter.watch.station import LABEL

# Limit of probes whose time from user to user is measured: a minute at 1,000 per second.
MOST_OPEN = 65_536
# A sender that is late may catch up by this much; more would be a burst.
CATCH_UP_S = 0.05
# A probe that returns after more than this time counts as a new one.
ECHO_S = 60.0


class Trip(NamedTuple):
    """Stations of a probe's sending and receiving user."""

    sender: str
    receiver: str


class Prober:
    """Gives probes to one station.

    rate      probes per second.
    most      total number of probes; None: no limit.
    options   options of the probes for the station's PULL socket.
    trips_us  time from giving a probe to the station until this program receives it as a user of each station, by one
              clock.
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
        # Probes by digest: time of sending, and stations that have delivered the probe.
        self._open: OrderedDict[str, tuple[int, set[str]]] = OrderedDict()

    @property
    def is_over(self) -> bool:
        return self._most is not None and self.count >= self._most

    def due_s(self, now_s: float) -> float:
        """Return seconds until the next probe; 0 if it is due."""
        if self._due_s is None:
            self._due_s = now_s
        return max(0.0, self._due_s - now_s)

    def send(self, now_s: float, now_ns: Callable[[], int]) -> None:
        """Send the next probe. Raises StationError if the station accepts no more."""
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
        """Note that a station has delivered a message to its users.

        It counts if it is a probe, delivered by this station for the first time.
        """
        began_ns, had = self._open.get(digest, (0, {station}))
        if station not in had:
            had.add(station)
            self.trips_us.setdefault(Trip(self.name, station), Sample()).add((now_ns - began_ns) / 1000)


class Reflector:
    """Sends each received probe back once, unchanged.

    reflected      number of reflected probes.
    not_reflected  number of probes that the station did not accept back.
    stay_us        time from reception on port 5556 to sending on port 5557.
    """

    def __init__(self, context: client.Context, place: client.Address, options: Mapping[str, object]) -> None:
        self.reflected = self.not_reflected = 0
        self.stay_us = Sample()
        self._pusher = client.push(context, place)
        self._options = dict(options)
        self._seen: OrderedDict[str, int] = OrderedDict()  # by digest: monotonic time in ns

    def take(self, message: Message, came_ns: int, now_ns: Callable[[], int]) -> None:
        """Reflect a message of port 5556 if it is a probe.

        A probe already reflected here is ignored, even if a second reflector has sent it back again.
        """
        if message.station != PROBES:
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
