"""One try to become a broker's client, as the station will, and by another name: it may run already."""

import os
import select
import time
from dataclasses import replace
from typing import Any, cast

from drivers.mqtt_settings import MqttSettings

REACH_S = 5.0  # for all of it


def why_not(wanted: MqttSettings) -> str:
    """Why the broker cannot be reached, or does not accept a client; empty: it does."""
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
                return f"{network.waits_for} within {REACH_S:g} s"
            reads, writes = network.wants()
            left = 0.0 if network.has_more else min(end, network.deadline()) - now
            ready, _, _ = select.select(reads, writes, [], max(0.0, left))
            network.turn(time.monotonic(), bool(ready))
        if not answer.why_not:
            network.disconnect()
            network.finish()
        return answer.why_not
    finally:
        network.drop()


class _Answer:
    """What Network says to a session before anything is published."""

    def __init__(self) -> None:
        self.is_there = False
        self.why_not = ""

    def connected(self, accepted: object, now: float) -> None:
        self.is_there = True

    def failed(self, why: str, now: float, is_away: bool = False) -> None:
        self.is_there, self.why_not = True, why

    lost = failed
