"""Bodies in the JSON of Vanetza-NAP's applications, and stations with its profile."""

import copy
import json
from pathlib import Path
from typing import Any

import captain_messages

import firmware
from drivers.mqtt.profile import MessageLibrary
from drivers.wire.v2n.profile import Delivery, Profile
from tests.drivers.wire.v2n.station import profile

LIBRARY = MessageLibrary(captain_messages.all())
VECTORS = [
    (vector["type"].lower(), bytes.fromhex(vector["hex"]))
    for vector in json.loads((Path(firmware.__file__).parent / "vectors.json").read_text())
]

# Members as in examples/in_cam.json of nap-it/vanetza-nap (release 2), with values of our own.
CAM = {
    "generationDeltaTime": 4711,
    "camParameters": {
        "basicContainer": {
            "stationType": 5,
            "referencePosition": {
                "latitude": 47.0707,
                "longitude": 15.4395,
                "positionConfidenceEllipse": {
                    "semiMajorAxisLength": 1.5,
                    "semiMinorAxisLength": 4095,
                    "semiMajorAxisOrientation": 3601,
                },
                "altitude": {"altitudeValue": 353.2, "altitudeConfidence": 15},
            },
        },
        "highFrequencyContainer": {
            "basicVehicleContainerHighFrequency": {
                "heading": {"headingValue": 92.3, "headingConfidence": 127},
                "speed": {"speedValue": 13.89, "speedConfidence": 0.5},
                "driveDirection": 0,
                "vehicleLength": {"vehicleLengthValue": 4.2, "vehicleLengthConfidenceIndication": 4},
                "vehicleWidth": 1.8,
                "longitudinalAcceleration": {"value": -0.4, "confidence": 102},
                "curvature": {"curvatureValue": 1023, "curvatureConfidence": 7},
                "curvatureCalculationMode": 2,
                "yawRate": {"yawRateValue": -1.25, "yawRateConfidence": 8},
                "accelerationControl": {"brakePedalEngaged": True, "accEngaged": False},
            }
        },
    },
}
# As in examples/in_cam_full.json: release 1.
OLD_CAM = copy.deepcopy(CAM)
OLD_CAM["camParameters"]["basicContainer"]["referencePosition"]["positionConfidenceEllipse"] = {
    "semiMajorConfidence": 1.5,
    "semiMinorConfidence": 4095,
    "semiMajorOrientation": 3601,
}
OLD_CAM["camParameters"]["highFrequencyContainer"]["basicVehicleContainerHighFrequency"]["longitudinalAcceleration"] = {
    "longitudinalAccelerationValue": -0.4,
    "longitudinalAccelerationConfidence": 102,
}
# As in examples/in_denm.json.
DENM = {
    "management": {
        "actionId": {"originatingStationId": 4711, "sequenceNumber": 3},
        "detectionTime": 700_000_000.25,
        "referenceTime": 700_000_001,
        "eventPosition": {
            "latitude": 47.0707,
            "longitude": 15.4395,
            "positionConfidenceEllipse": {
                "semiMajorConfidence": 0.4,
                "semiMinorConfidence": 0.3,
                "semiMajorOrientation": 135.5,
            },
            "altitude": {"altitudeValue": 0, "altitudeConfidence": 1},
        },
        "validityDuration": 60,
        "stationType": 5,
    },
    "situation": {"informationQuality": 7, "eventType": {"ccAndScc": {"wrongWayDriving14": 0}}},
    # Members added in release 2 are in an object of their own, as in examples/out_denm.json.
    "location": {
        "eventPositionHeading": {"value": 2700, "confidence": 8},
        "detectionZonesToEventPosition": [
            [{"pathPosition": {"deltaLatitude": 0.0002, "deltaLongitude": 0.0004, "deltaAltitude": 1}}]
        ],
        "ext1": {"linkedMapems": [{"roadsegment": {"region": 15, "id": 8}}]},
    },
}
# As in examples/in_cpm.json, where containerId alone determines the type of containerData.
CPM = {
    "managementContainer": {
        "referenceTime": 700_000_000,
        "referencePosition": DENM["management"]["eventPosition"],  # type: ignore[index]
    },
    "cpmContainers": [
        {
            "containerId": 1,
            "containerData": {"orientationAngle": {"value": 900, "confidence": 1}},
        }
    ],
}  # fmt: skip


def station(number: int = 7) -> Profile:
    return profile("nap", station=number)


def sent(kind: str, body: dict[str, Any]) -> bytes:
    return station().receive(Delivery(f"vanetza/in/{kind}", json.dumps(body).encode())).pdu
