"""Health check of a station: configuration, endpoint, heartbeat."""

import json
import os
import time
from collections.abc import Callable, Mapping

import zmq

from board.runtime.errors import StationError
from firmware.config import captain_toml
from firmware.config.tables import EndpointOptions
from firmware.endpoint.users import HEARTBEAT

# Heartbeats come once a second. Three in a row show that the station neither hangs nor keeps restarting.
ENOUGH = 3
# The station of a Pi 4 is up after some 20 s; a missing module does not delay heartbeats.
LIMIT_S = 300.0
EVERYWHERE = ("0.0.0.0", "*", "::")
STEP_S = 5.0
AGAIN = "look at `journalctl -u captain` and `captain doctor`"

Clock = Callable[[], float]


def check(limit_s: float = LIMIT_S, environment: Mapping[str, str] = os.environ, clock: Clock = time.monotonic) -> str:
    """Return a description of a healthy station. Raises StationError with the fault, after limit_s at the latest.

    environment  CAPTAIN_CONFIG, CAPTAIN_DEFAULTS and CAPTAIN_BOARD, as in the station's unit.
    """
    tables = captain_toml.load(
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
                raise StationError(f"the station does not work after {limit_s:.0f} s: {counts.words}", AGAIN)
            if subscriber.poll(round(min(left, STEP_S) * 1000)):
                counts.take(subscriber.recv_multipart()[-1])
            else:
                counts.miss()
    finally:
        subscriber.close(0)
        context.term()
    return f"the configuration loads, the endpoint answers, {counts.words}"


class Counts:
    """Consecutive heartbeats. words: a description of those seen."""

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
        return "no heartbeat received" if not self._most else f"heartbeats stop or restart after {self._most}"

    def take(self, body: bytes) -> None:
        """Count the body of a heartbeat; one that does not follow the previous one starts the count again."""
        try:
            count = int(json.loads(body)["heartbeat_counter"])
        except (ValueError, KeyError, TypeError):
            self.miss()
            return
        follows = not self._seen or count == (self._seen[-1] + 1) & 0xFFFF
        self._seen = [*self._seen, count] if follows else [count]
        self._most = max(self._most, len(self._seen))

    def miss(self) -> None:
        """Start the count again after a missing heartbeat."""
        self._seen = []


def address(endpoint: EndpointOptions) -> str:
    """Return the ZeroMQ address of the port that sends heartbeats, as reachable from this machine."""
    host = "127.0.0.1" if endpoint.address in EVERYWHERE else endpoint.address
    return f"tcp://[{host}]:{endpoint.to_users}" if ":" in host else f"tcp://{host}:{endpoint.to_users}"
