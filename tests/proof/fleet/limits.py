"""Fleet size at which a profile exceeds a limit.

A vehicle's received messages grow with the fleet, and a broker's sent ones with its square. Vehicles are spread
alike, whatever share of the traffic has a station. So one computed load gives the limit.
"""

import math
from typing import NamedTuple

from tests.proof.fleet.load import Load

# Assumptions; --downlink-kbit and --broker-rate are others.
# 1 Mbit/s: a mobile cell of 50 Mbit/s for 50 vehicles; in an hour it is 450 MB.
DOWNLINK_BITS = 1e6
# One mosquitto runs on one core: half of the 67,000 to 100,000 packets a second that `make fleet` has measured, which
# leaves room for what it takes in.
BROKER_RATE = 50_000.0


class Limits(NamedTuple):
    """downlink  bits a second that 95 of 100 vehicles must stay below. broker_rate: messages a second out of one."""

    downlink: float = DOWNLINK_BITS
    broker_rate: float = BROKER_RATE


class Breaks(NamedTuple):
    """Vehicles with which a limit is reached."""

    downlink: int
    one_broker: int


def breaks(load: Load, limits: Limits) -> Breaks:
    size = load.fleet.size
    return Breaks(
        math.floor(size * limits.downlink / load.downlink.busy),
        math.floor(size * math.sqrt(limits.broker_rate / load.delivered.messages)),
    )
