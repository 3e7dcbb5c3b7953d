"""Broker in virtual time: sessions, publications, deliveries."""

import math
from collections import defaultdict
from collections.abc import Callable

from board.runtime.loop import Loop
from drivers.mqtt.client.window import Accepted
from drivers.wire.v2n.profile import Publication
from tests.proof.outage.network import Network


class Kept:
    """What a broker has of a client.

    filters      that it is subscribed to.
    connections  that were accepted. seen: when the last octets came by one.
    """

    def __init__(self) -> None:
        self.filters: set[str] = set()
        self.connections = self.resumed = 0
        self.seen = -math.inf


class Broker:
    """Takes what arrives.

    left     called with the client, its connection's number and a publication that its socket has taken.
    arrived  called with the client and each publication.
    """

    def __init__(
        self,
        loop: Loop,
        network: Network,
        left: Callable[[str, int, Publication], None],
        arrived: Callable[[str, Publication], None],
    ) -> None:
        self.loop = loop
        self.network = network
        self.left = left
        self.arrived = arrived
        self.kept: defaultdict[str, Kept] = defaultdict(Kept)

    def accept(self, name: str, is_clean: bool, forgets_s: float) -> Accepted:
        """CONNECT. forgets_s: after which a session of a client that says nothing is over."""
        kept = self.kept[name]
        is_resumed = not is_clean and kept.connections > 0 and self.loop.clock() - kept.seen < forgets_s
        if not is_resumed:
            kept.filters.clear()
        kept.connections += 1
        kept.resumed += is_resumed
        kept.seen = self.loop.clock()
        return Accepted(is_resumed=is_resumed)
