"""Trial connection to a broker under a client name of its own."""

import errno
import os
import time
from dataclasses import replace
from typing import NamedTuple

from drivers.mqtt.client import trouble
from drivers.mqtt.client.settings import MqttSettings
from drivers.reason import Reason
from drivers.wire.v2n.message import Delivery

REACH_S = 5.0  # time limit of the whole trial


# Errors that pass once the network is up or the broker runs; they need no change of the configuration.
_PASSING = tuple(
    trouble.why(OSError(code, os.strerror(code)))
    for code in (errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EADDRNOTAVAIL, errno.ETIMEDOUT)
)


class Failure(NamedTuple):
    """Failure of a trial connection.

    why       reason.
    may_pass  it may pass by itself; otherwise configuration or broker must be changed.
    """

    why: str
    may_pass: bool


def failure(wanted: MqttSettings) -> Failure | None:
    """Return why the broker cannot be reached or rejects this client; None if it accepts."""
    # paho-mqtt is imported on demand, so that other commands start without it.
    from drivers.mqtt.client.network import Network

    name = f"captain-doctor-{os.urandom(4).hex()}"
    network = Network(replace(wanted, client_id=name, clean=True, connect_s=REACH_S), None)
    answer = _Answer()
    # The look-up of a name has no limit of its own, so this one includes it.
    end = time.monotonic() + REACH_S
    network.connect()
    try:
        while not answer.is_there:
            if time.monotonic() >= end:
                return Failure(f"{network.waits_for} within {REACH_S:g} s", True)
            network.wait(answer, end)
        if answer.failure is None:
            network.disconnect()
            network.finish()
        return answer.failure
    finally:
        network.drop()


class _Answer:
    """Answer of the broker to CONNECT, received as NetworkEvents. The trial neither subscribes nor publishes."""

    def __init__(self) -> None:
        self.is_there = False
        self.failure: Failure | None = None

    def connected(self, accepted: object, now: float) -> None:
        self.is_there = True

    def failed(self, why: str, now: float, is_away: bool = False) -> None:
        self.is_there, self.failure = True, Failure(why, is_away or why.endswith(_PASSING) or " within " in why)

    def lost(self, why: str, now: float, is_cut: bool = False, code: int = 0) -> None:
        self.failed(why, now, is_cut)

    def subscribed(self, refused: dict[str, str], now: float) -> None: ...
    def unsubscribed(self, now: float) -> None: ...
    def published(self, token: int, why: str, now: float) -> None: ...
    def writable(self, now: float) -> None: ...
    def received(self, delivery: Delivery, now: float) -> None: ...
    def drop(self, reason: Reason, sample: bytes, count: int = 1, why: str = "") -> None: ...
