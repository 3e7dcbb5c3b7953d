"""Station of a swarm: its UDP address, and reception by its users."""

import time
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from board.runtime.address import Address, address
from board.runtime.errors import ConfigurationError, StationError
from drivers.message import ITS_HEADER
from firmware.client import client
from firmware.printable import clean
from firmware.untrusted import named, text, within

FRAMINGS = ("ethernet", "btp", "pdu")
ANYWHERE = "0.0.0.0"
LATE_S = 1.0  # seconds after the end; messages received later do not count
REMEDY = "use --udp HOST:PORT, --ethernet DEVICE or --endpoint, or start `captain run`"


class StationAddress(NamedTuple):
    """UDP address on which a station receives.

    to       address and port.
    framing  framing of the datagrams, as option framing of a `udp` interface.
    station  name of the station.
    """

    to: Address
    framing: str
    station: str


def ear_of(status: Mapping[str, object], host: str) -> StationAddress:
    """Return the address at which a station receives UDP: that of its simulated radio, or of its first `udp` interface.

    host  host of the station.

    Raises StationError if it receives no UDP, or only from its own machine.
    """
    name = clean(text(status, "station"))
    for place, framing in _ears(status):
        if place.host == ANYWHERE:
            return StationAddress(Address(host, place.port), framing, name)
        if place.host.startswith("127.") and host not in client.LOCAL:
            raise StationError(
                f"station {name} at {host} listens on {place}, which only its own machine can reach", REMEDY
            )
        return StationAddress(place, framing, name)
    raise StationError(f"station {name} at {host} has no interface that receives UDP", REMEDY)


def _ears(status: Mapping[str, object]) -> Iterator[tuple[Address, str]]:
    found = [(text(within(status, "simulation"), "hears"), FRAMINGS[0])]
    for _, one in named(status, "interfaces"):
        details = within(one, "details")
        found.append((text(details, "listen"), text(details, "framing")))
    for place, framing in found:
        if place and framing in FRAMINGS:
            try:
                yield address(place), framing
            except ConfigurationError:
                continue


class Audience:
    """User of the station that waits for the first message of the swarm.

    stations     stationIDs of the swarm.
    is_reached   a message of the swarm was received.

    Raises StationError if the station has no endpoint for users.
    """

    def __init__(self, context: client.Context, place: client.Address, stations: range) -> None:
        self.is_reached = False
        self._stations = stations
        self._subscriber = client.subscribe(context, place, place.to_users, "v2x.")

    def look(self) -> None:
        """Read the messages that have arrived, until the first one of the swarm."""
        if self.is_reached:
            return
        for frames in client.waiting(self._subscriber):
            pdu = frames[-1]
            if len(pdu) >= ITS_HEADER and int.from_bytes(pdu[2:6]) in self._stations:
                self.is_reached = True
                self._subscriber.close()  # one message is enough: reading all of a swarm would cost too much
                return

    def wait(self) -> None:
        """Wait for a message of the swarm, at most LATE_S."""
        until = time.monotonic() + LATE_S
        self.look()
        while not self.is_reached and (left := until - time.monotonic()) > 0:
            self._subscriber.poll(round(left * 1000) + 1)
            self.look()
