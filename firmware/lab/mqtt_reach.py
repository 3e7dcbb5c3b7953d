"""One try to become a broker's client, as the station will, and by another name: it may run already."""

import errno
import os
import select
import time
from dataclasses import replace
from typing import Any, NamedTuple, cast

from drivers import mqtt_trouble
from drivers.mqtt_settings import MqttSettings

REACH_S = 5.0  # for all of it


# What a network that comes or a broker that starts mends: nothing here is wrong.
_PASSING = tuple(
    mqtt_trouble.why(OSError(code, os.strerror(code)))
    for code in (errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ENETUNREACH, errno.EADDRNOTAVAIL, errno.ETIMEDOUT)
)


class Failure(NamedTuple):
    """may_pass  without anybody's doing: else configuration or broker must be another."""

    why: str
    may_pass: bool


def failure(wanted: MqttSettings) -> Failure | None:
    """Why the broker cannot be reached, or does not accept a client; None: it does."""
    # paho-mqtt is imported by no more commands than need it.
    from drivers.mqtt_network import Network

    name = f"captain-doctor-{os.urandom(4).hex()}"
    network = Network(replace(wanted, client_id=name, clean=True, connect_s=REACH_S), None)
    answer = _Answer()
    network.session = cast(Any, answer)
    # A look-up has no limit of its own.
    end = time.monotonic() + REACH_S
    network.connect()
    try:
        while not answer.is_there:
            now = time.monotonic()
            if now >= end:
                return Failure(f"{network.waits_for} within {REACH_S:g} s", True)
            reads, writes = network.wants()
            left = 0.0 if network.has_more else min(end, network.deadline()) - now
            ready, _, _ = select.select(reads, writes, [], max(0.0, left))
            network.turn(time.monotonic(), bool(ready))
        if answer.failure is None:
            network.disconnect()
            network.finish()
        return answer.failure
    finally:
        network.drop()


class _Answer:
    """What Network says to a session before anything is published."""

    def __init__(self) -> None:
        self.is_there = False
        self.failure: Failure | None = None

    def connected(self, accepted: object, now: float) -> None:
        self.is_there = True

    def failed(self, why: str, now: float, is_away: bool = False) -> None:
        self.is_there, self.failure = True, Failure(why, is_away or why.endswith(_PASSING) or " within " in why)

    lost = failed
