"""Rates and lengths of a vehicle's messages.

CAM   by the rules of EN 302 637-2 V1.4.1, clause 6.1.3: when since the last one the position has changed by more than
      4 m, the speed by more than 0.5 m/s or the heading by more than 4 degrees, looked at every T_CheckCamGen; between
      T_GenCamMin and T_GenCamMax. DCC allows T_GenCamMin.
CPM   by TS 103 324 V2.1.1, clause 6.1: a perceived object is included under the same thresholds, or after a second; a
      CPM is made when one is. Who perceives is an assumption: CPM_SHARE of the vehicles, half of what is around, at most
      MAX_OBJECTS.
DENM  EN 302 637-3 leaves repetition to the application. An assumption: DENM_SHARE of the vehicles at a time, DENM_HZ.

Octets are those of recorded messages in firmware/vectors.json: a DENM, and a CAM with and without low frequency
container. That container is in a CAM when the last such is 500 ms old or older (EN 302 637-2, clause 6.1.3). The
recorded CPM is one of TR 103 562, which profile orange does not send. `captain swarm` writes one of TS 103 324, about
as long.
"""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from drivers.sim.track import Motion
from firmware.swarm.messages import Writer
from tests.proof.fleet.region import LATITUDE, LONGITUDE, Vehicle

CHECK_S = 0.1  # T_CheckCamGen: at most T_GenCamMin
LEAST, MOST = 1, 10  # checks: T_GenCamMin 100 ms, T_GenCamMax 1000 ms
METRES, SPEED, DEGREES = 4.0, 0.5, 4.0
LOW_FREQUENCY_S = 0.5

CPM_SHARE = 0.3
MAX_OBJECTS = 8
DENM_SHARE = 0.005
DENM_HZ = 1.0

VECTORS = Path(__file__).parents[3] / "firmware" / "vectors.json"
# Which of the messages, by type and octets.
CAM, CAM_LOW_FREQUENCY, DENM, CPM = ("cam", 46), ("cam", 160), ("denm", 43), ("cpm", 619)
OBJECTS = 31  # in the CPM: 619 octets, where the recorded one has 624
MESSAGES = (CAM, CAM_LOW_FREQUENCY, DENM, CPM)
PORTS = {"cam": 2001, "denm": 2002, "cpm": 2009}

Message = tuple[str, int]  # type and octets: a key of recorded()


class Rates(NamedTuple):
    """Messages a second of one vehicle, by which of the messages they are like."""

    cam: float
    cam_low_frequency: float
    denm: float
    cpm: float

    @property
    def by_message(self) -> tuple[tuple[Message, float], ...]:
        return tuple(zip(MESSAGES, self, strict=True))

    @property
    def total(self) -> float:
        return sum(self)


def recorded() -> Mapping[Message, bytes]:
    """The PDUs."""
    rows = json.loads(VECTORS.read_text())
    cpm = _cpm()
    return {(row["type"], row["octets"]): bytes.fromhex(row["hex"]) for row in rows} | {("cpm", len(cpm)): cpm}


def _cpm() -> bytes:
    """Return a CPM of OBJECTS objects in a row, 1 m apart."""
    own = Motion(round(LATITUDE * 1e7), round(LONGITUDE * 1e7), 0, 0, 0)
    objects = [(number, own._replace(latitude=own.latitude + 90 * number)) for number in range(OBJECTS)]
    return Writer().cpm(1337, 0, own, objects)


def cam_checks(speed: float, acceleration: float, yaw: float) -> int:
    """After how many checks a CAM is made, of a vehicle that goes on as it does."""
    changes = [each for each in _changes(speed, acceleration, yaw) if CHECK_S * MOST * each[1] > each[0]]
    waits = [threshold / (CHECK_S * change) for threshold, change in changes]
    # More than the threshold: at exactly 4 m it is not made yet.
    return min([MOST, *(max(LEAST, math.floor(wait) + 1) for wait in waits)])


def _changes(speed: float, acceleration: float, yaw: float) -> tuple[tuple[float, float], ...]:
    return (METRES, speed), (SPEED, abs(acceleration)), (DEGREES, abs(yaw))


def rates(vehicle: Vehicle, number: int) -> Rates:
    """Of a vehicle of the fleet; number is its place there: who has sensors and who warns follows from it."""
    checks = cam_checks(vehicle.speed, vehicle.acceleration, vehicle.yaw)
    cam = 1 / (CHECK_S * checks)
    low = 1 / (CHECK_S * checks * math.ceil(LOW_FREQUENCY_S / (CHECK_S * checks)))
    denm = DENM_HZ if _is_among(number, DENM_SHARE, math.sqrt(2)) else 0.0
    cpm = cpm_hz(vehicle, checks) if _is_among(number, CPM_SHARE, math.sqrt(3)) else 0.0
    return Rates(cam - low, low, denm, cpm)


def cpm_hz(vehicle: Vehicle, checks: int) -> float:
    """Objects move as the vehicle does: in a check none of n is due with (1 - 1 / checks) ** n."""
    objects = min(MAX_OBJECTS, vehicle.around / 2)
    return max(1.0, (1 - (1 - 1 / checks) ** objects) / CHECK_S)


def _is_among(number: int, share: float, irrational: float) -> bool:
    """The same vehicles in every fleet, spread evenly over its numbers."""
    return number * irrational % 1.0 < share
