"""Messages of virtual stations, encoded: CAM, DENM, CPM."""

from collections.abc import Sequence
from math import cos, radians
from typing import NamedTuple

from drivers.sim.track import METRES, Motion
from firmware.codec.library import load

PASSENGER_CAR = 5  # StationType
LENGTH_DM, WIDTH_DM = 42, 18
ACCIDENT = 2  # CauseCodeType
# Half axes in cm of the 95 % confidence ellipse: those of a good receiver. The simulated positions themselves are
# exact.
ELLIPSE = {"semiMajorConfidence": 100, "semiMinorConfidence": 100, "semiMajorOrientation": 0}
MOST_OBJECTS = 20
REACH_M = 100.0  # range of a vehicle's sensors
CPMS = ("cpm-2.1.1", "cpm-2.1.1-ext")  # editions of the CPM with the same fields
_DELTA = 131_071  # limit of DeltaLatitude and DeltaLongitude, 1e-7 degree
_VELOCITY, _COORDINATE = 16_382, 131_070


class Past(NamedTuple):
    """Past position of a vehicle; its_ms: ITS time in ms."""

    its_ms: int
    motion: Motion


class Writer:
    """Encodes messages of virtual stations. Raises NoLibraryError without a message library.

    cpm  edition of the CPM: one of CPMS.
    """

    def __init__(self, cpm: str = CPMS[0]) -> None:
        library = load()
        self._cam, self._denm, self._cpm = (library.find(name) for name in ("cam-1.4.1", "denm-1.3.1", cpm))

    def cam(
        self, station_id: int, its_ms: int, motion: Motion, acceleration: float, low: Sequence[Past] | None
    ) -> bytes:
        """Return an encoded CAM.

        acceleration  m/s^2.
        low           past positions, the latest first, if the low-frequency container is due; None: without it.
        """
        parameters: dict[str, object] = {
            "basicContainer": {"stationType": PASSENGER_CAR, "referencePosition": _reference_position(motion, ELLIPSE)},
            "highFrequencyContainer": ("basicVehicleContainerHighFrequency", _fast(motion, acceleration)),
        }
        if low is not None:
            slow = {"vehicleRole": "default", "exteriorLights": (b"\0", 8), "pathHistory": _path(its_ms, motion, low)}
            parameters["lowFrequencyContainer"] = ("basicVehicleContainerLowFrequency", slow)
        header = {"protocolVersion": 2, "messageID": 2, "stationID": station_id}
        body = {"generationDeltaTime": its_ms % 65536, "camParameters": parameters}
        return self._cam.encode({"header": header, "cam": body})

    def denm(
        self, station_id: int, sequence: int, detected_ms: int, its_ms: int, position: Motion, is_over: bool
    ) -> bytes:
        """Return an encoded DENM for an accident at a position; is_over: it cancels the event."""
        management: dict[str, object] = {
            "actionID": {"originatingStationID": station_id, "sequenceNumber": sequence % 65536},
            "detectionTime": detected_ms,
            "referenceTime": its_ms,
            "eventPosition": _reference_position(position, ELLIPSE),
            "relevanceDistance": "lessThan500m",
            "validityDuration": 60,
            "stationType": PASSENGER_CAR,
        }
        body: dict[str, object] = {"management": management}
        if is_over:
            management["termination"] = "isCancellation"
        else:
            cause = {"causeCode": ACCIDENT, "subCauseCode": 0}
            body["situation"] = {"informationQuality": 3, "eventType": cause}
        return self._denm.encode(
            {"header": {"protocolVersion": 2, "messageID": 1, "stationID": station_id}, "denm": body}
        )

    def cpm(self, station_id: int, its_ms: int, motion: Motion, objects: Sequence[tuple[int, Motion]]) -> bytes:
        """Return an encoded CPM; objects: number and motion of each vehicle nearby."""
        containers: list[object] = [{"containerId": 1, "containerData": {"orientationAngle": _angle(motion)}}]
        if objects:
            seen = [_object(motion, *one) for one in objects]
            data = {"numberOfPerceivedObjects": len(seen), "perceivedObjects": seen}
            containers.append({"containerId": 5, "containerData": data})
        management = {"referenceTime": its_ms, "referencePosition": _reference_position(motion, ELLIPSE)}
        header = {"protocolVersion": 2, "messageId": 14, "stationId": station_id}
        payload = {"managementContainer": management, "cpmContainers": containers}
        return self._cpm.encode({"header": header, "payload": payload})


def _reference_position(motion: Motion, ellipse: dict[str, int]) -> dict[str, object]:
    altitude = {"altitudeValue": motion.altitude_mm // 10, "altitudeConfidence": "unavailable"}
    return {
        "latitude": motion.latitude,
        "longitude": motion.longitude,
        "positionConfidenceEllipse": ellipse,
        "altitude": altitude,
    }


def _fast(motion: Motion, acceleration: float) -> dict[str, object]:
    """Return a BasicVehicleContainerHighFrequency; its units are 0.1 degree, 0.01 m/s, 0.1 m/s^2."""
    return {
        "heading": {"headingValue": motion.heading // 10_000 % 3600, "headingConfidence": 10},
        "speed": {"speedValue": min(motion.speed_mm_s // 10, 16_382), "speedConfidence": 10},
        "driveDirection": "forward",
        "vehicleLength": {
            "vehicleLengthValue": LENGTH_DM,
            "vehicleLengthConfidenceIndication": "noTrailerPresent",
        },
        "vehicleWidth": WIDTH_DM,
        "longitudinalAcceleration": {
            "longitudinalAccelerationValue": max(-160, min(round(acceleration * 10), 160)),
            "longitudinalAccelerationConfidence": 102,
        },
        "curvature": {"curvatureValue": 0, "curvatureConfidence": "unavailable"},
        "curvatureCalculationMode": "unavailable",
        "yawRate": {"yawRateValue": 0, "yawRateConfidence": "unavailable"},
    }


def _path(its_ms: int, motion: Motion, low: Sequence[Past]) -> list[object]:
    """Return a PathHistory: each point relative to the one before it, the first relative to the vehicle."""
    points: list[object] = []
    when, at = its_ms, motion
    for past in low:
        north, east = past.motion.latitude - at.latitude, past.motion.longitude - at.longitude
        if max(abs(north), abs(east)) > _DELTA:
            break
        position = {"deltaLatitude": north, "deltaLongitude": east, "deltaAltitude": 12_800}  # 12,800: unavailable
        points.append({"pathPosition": position, "pathDeltaTime": max(1, min((when - past.its_ms) // 10, 65_535))})
        when, at = past
    return points


def _angle(motion: Motion) -> dict[str, int]:
    return {"value": motion.heading // 10_000 % 3600, "confidence": 10}


def _object(own: Motion, number: int, other: Motion) -> dict[str, object]:
    """Return a PerceivedObject, east and north of the own position in cm and cm/s (TS 103 324 clause 7.1.3)."""
    north = round((other.latitude - own.latitude) * 1e-7 * METRES * 100)
    east = round((other.longitude - own.longitude) * 1e-7 * METRES * cos(radians(own.latitude * 1e-7)) * 100)
    angle = radians(90 - other.heading / 1e5)
    speed = other.speed_mm_s / 10
    velocity = {
        "xVelocity": {"value": _within(round(speed * cos(angle)), _VELOCITY), "confidence": 10},
        "yVelocity": {"value": _within(round(speed * cos(angle - radians(90))), _VELOCITY), "confidence": 10},
    }
    return {
        "objectId": number % 65_536,
        "measurementDeltaTime": 0,
        "position": {
            "xCoordinate": {"value": _within(east, _COORDINATE), "confidence": 50},
            "yCoordinate": {"value": _within(north, _COORDINATE), "confidence": 50},
        },
        "velocity": ("cartesianVelocity", velocity),
    }


def _within(value: int, most: int) -> int:
    return max(-most, min(value, most))
