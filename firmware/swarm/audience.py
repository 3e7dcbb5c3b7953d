"""Station of a swarm: address where it receives UDP, and reception by its users."""

import time
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from board.address import Address, address
from board.errors import ConfigurationError, StationError
from drivers.message import ITS_HEADER
from firmware.printable import clean
from firmware.user import client
from firmware.user.untrusted import named, text, within

FRAMINGS = ("ethernet", "btp", "pdu")
ANYWHERE = "0.0.0.0"
LATE_S = 1.0  # after the end: messages that a user receives later do not count
REMEDY = "use --udp HOST:PORT, --ethernet DEVICE or --endpoint, or start `captain run`"


class Ear(NamedTuple):
    """UDP address on which a station receives.

    framing  of the datagrams, as option framing of a `udp` interface.
    """

    to: Address
    framing: str
    station: str


def ear_of(status: Mapping[str, object], host: str) -> Ear:
    """Return the address on which a station receives UDP: its simulated radio, else its first `udp` interface.

    host  of the station. Raises StationError if it receives no UDP, or none from this machine.
    """
    name = clean(text(status, "station"))
    for place, framing in _ears(status):
        if place.host == ANYWHERE:
            return Ear(Address(host, place.port), framing, name)
        if place.host.startswith("127.") and host not in client.LOCAL:
            raise StationError(
                f"station {name} at {host} listens on {place}, which only its own machine can reach", REMEDY
            )
        return Ear(place, framing, name)
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
    is_reached   a message was received.

    Raises StationError if the station has no user endpoint.
    """

    def __init__(self, context: client.Context, place: client.Address, stations: range) -> None:
        self.is_reached = False
        self._stations = stations
        self._subscriber = client.subscribe(context, place, place.to_users, "v2x.")

    def look(self) -> None:
        """Take what has come, until the first of the swarm."""
        if self.is_reached:
            return
        for frames in client.waiting(self._subscriber):
            pdu = frames[-1]
            if len(pdu) >= ITS_HEADER and int.from_bytes(pdu[2:6]) in self._stations:
                self.is_reached = True
                self._subscriber.close()  # one is enough: a flood is for others
                return

    def wait(self) -> None:
        """Look until one has come, LATE_S at most."""
        until = time.monotonic() + LATE_S
        self.look()
        while not self.is_reached and (left := until - time.monotonic()) > 0:
            self._subscriber.poll(round(left * 1000) + 1)
            self.look()
