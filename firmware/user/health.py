"""Whether a station is well: its configuration loads, its endpoint answers, its heartbeat counts upward."""

import json
import os
import time
from collections.abc import Callable, Mapping

import zmq

from board.errors import StationError
from firmware import config
from firmware.tables import EndpointOptions
from firmware.users import HEARTBEAT

# One a second. Three in a row: it neither stands nor has just begun again.
ENOUGH = 3
# A Pi 4's station is up after some 20 s. A module that is missing keeps no heartbeat away.
LIMIT_S = 300.0
EVERYWHERE = ("0.0.0.0", "*", "::")
STEP_S = 5.0
AGAIN = "look at `journalctl -u captain` and `captain doctor`"

Clock = Callable[[], float]


def check(limit_s: float = LIMIT_S, environment: Mapping[str, str] = os.environ, clock: Clock = time.monotonic) -> str:
    """What was seen of a station that is well. Raises StationError: what is not well, after limit_s at the latest.

    environment  CAPTAIN_CONFIG, CAPTAIN_DEFAULTS, CAPTAIN_BOARD, as the station's unit has them.
    """
    tables = config.load(
        environment.get("CAPTAIN_CONFIG") or None,
        (),
        environment.get("CAPTAIN_BOARD") or None,
        environment.get("CAPTAIN_DEFAULTS") or None,
    ).tables
    counts = Counts()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    subscriber = context.socket(zmq.SUB)
    try:
        subscriber.set(zmq.SUBSCRIBE, HEARTBEAT)
        subscriber.set(zmq.IPV6, 1)
        subscriber.set(zmq.RECONNECT_IVL, 500)
        subscriber.connect(address(tables.endpoint))
        ends = clock() + limit_s
        while not counts.are_enough:
            left = ends - clock()
            if left <= 0:
                raise StationError(f"the station is not well after {limit_s:.0f} s: {counts.words}", AGAIN)
            if subscriber.poll(round(min(left, STEP_S) * 1000)):
                counts.take(subscriber.recv_multipart()[-1])
            else:
                counts.miss()
    finally:
        subscriber.close(0)
        context.term()
    return f"the configuration loads, the endpoint answers, {counts.words}"


class Counts:
    """Heartbeats one after the other. words: what was seen of them."""

    def __init__(self) -> None:
        self._seen: list[int] = []
        self._most = 0

    @property
    def are_enough(self) -> bool:
        return len(self._seen) >= ENOUGH

    @property
    def words(self) -> str:
        if self._seen:
            return f"heartbeats {', '.join(map(str, self._seen))}"
        return "no heartbeat came" if not self._most else f"heartbeats stop, or begin again, after {self._most}"

    def take(self, body: bytes) -> None:
        """The body of a heartbeat. One that does not follow the last one begins anew."""
        try:
            count = int(json.loads(body)["heartbeat_counter"])
        except (ValueError, KeyError, TypeError):
            self.miss()
            return
        follows = not self._seen or count == (self._seen[-1] + 1) & 0xFFFF
        self._seen = [*self._seen, count] if follows else [count]
        self._most = max(self._most, len(self._seen))

    def miss(self) -> None:
        """None came in time."""
        self._seen = []


def address(endpoint: EndpointOptions) -> str:
    """Of the port that heartbeats come from, as this machine reaches it."""
    host = "127.0.0.1" if endpoint.address in EVERYWHERE else endpoint.address
    return f"tcp://[{host}]:{endpoint.to_users}" if ":" in host else f"tcp://{host}:{endpoint.to_users}"
