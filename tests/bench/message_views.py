"""Five fields of each benchmark message, read by a view and a reader."""

import json
from pathlib import Path
from typing import NamedTuple

VECTORS = Path(__file__).resolve().parents[2] / "firmware" / "vectors.json"


class Case(NamedTuple):
    """A real message, the statement that reads five of its fields from a view, as timeit takes it, and their paths."""

    name: str
    octets: bytes
    read: str
    paths: tuple[str, ...]


CAM = """
view = decode(octets)
cam = view.cam
basic = cam.camParameters.basicContainer
position = basic.referencePosition
view.header.stationID
cam.generationDeltaTime
basic.stationType
position.latitude
position.longitude
"""
DENM = """
view = decode(octets)
management = view.denm.management
position = management.eventPosition
view.header.stationID
management.detectionTime
position.latitude
position.longitude
view.denm.situation.eventType.causeCode
"""
SPATEM = """
view = decode(octets)
intersection = view.spat.intersections[0]
movement = intersection.states[0]
view.header.stationID
intersection.id.id
intersection.revision
movement.signalGroup
movement.state_time_speed[0].eventState
"""
MAPEM = """
view = decode(octets)
intersection = view.map.intersections[0]
point = intersection.refPoint
view.header.stationID
intersection.id.id
point.lat
point.long
intersection.laneSet[0].laneID
"""
IVIM = """
view = decode(octets)
mandatory = view.ivi.mandatory
provider = mandatory.serviceProviderId
view.header.stationID
mandatory.iviIdentificationNumber
mandatory.iviStatus
provider.countryCode
provider.providerIdentifier
"""
CPM = """
view = decode(octets)
cpm = view.cpm
management = cpm.cpmParameters.managementContainer
position = management.referencePosition
view.header.stationID
cpm.generationDeltaTime
management.stationType
position.latitude
position.longitude
"""
HEADER = "header.stationID"
PATHS = {
    CAM: (
        HEADER,
        "cam.generationDeltaTime",
        "cam.camParameters.basicContainer.stationType",
        "cam.camParameters.basicContainer.referencePosition.latitude",
        "cam.camParameters.basicContainer.referencePosition.longitude",
    ),
    DENM: (
        HEADER,
        "denm.management.detectionTime",
        "denm.management.eventPosition.latitude",
        "denm.management.eventPosition.longitude",
        "denm.situation.eventType.causeCode",
    ),
    SPATEM: (
        HEADER,
        "spat.intersections[0].id.id",
        "spat.intersections[0].revision",
        "spat.intersections[0].states[0].signalGroup",
        "spat.intersections[0].states[0].state-time-speed[0].eventState",
    ),
    MAPEM: (
        HEADER,
        "map.intersections[0].id.id",
        "map.intersections[0].refPoint.lat",
        "map.intersections[0].refPoint.long",
        "map.intersections[0].laneSet[0].laneID",
    ),
    IVIM: (
        HEADER,
        "ivi.mandatory.iviIdentificationNumber",
        "ivi.mandatory.iviStatus",
        "ivi.mandatory.serviceProviderId.countryCode",
        "ivi.mandatory.serviceProviderId.providerIdentifier",
    ),
    CPM: (
        HEADER,
        "cpm.generationDeltaTime",
        "cpm.cpmParameters.managementContainer.stationType",
        "cpm.cpmParameters.managementContainer.referencePosition.latitude",
        "cpm.cpmParameters.managementContainer.referencePosition.longitude",
    ),
}
READS = (
    ("cam-1.4.1", 46, CAM),
    ("cam-1.4.1", 143, CAM),
    ("denm-1.3.1", 404, DENM),
    ("spatem-2.1.1", 203, SPATEM),
    ("mapem-2.1.1", 536, MAPEM),
    ("ivim-2.1.1", 73, IVIM),
    ("cpm-tr-2.1.1", 624, CPM),
)
"""Message, octets of the one of firmware/vectors.json, statement."""


def cases() -> list[Case]:
    vectors = [(vector["octets"], bytes.fromhex(vector["hex"])) for vector in json.loads(VECTORS.read_text())]
    return [
        Case(name, next(octets for count, octets in vectors if count == wanted), read, PATHS[read])
        for name, wanted, read in READS
    ]
