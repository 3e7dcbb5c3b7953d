"""What a program reads from a view: five fields of each message of the benchmark."""

from collections.abc import Callable
from typing import Any


def cam(view: Any) -> object:
    cam = view.cam
    basic = cam.camParameters.basicContainer
    position = basic.referencePosition
    return view.header.stationID, cam.generationDeltaTime, basic.stationType, position.latitude, position.longitude


def denm(view: Any) -> object:
    management = view.denm.management
    position = management.eventPosition
    return (
        view.header.stationID, management.detectionTime, position.latitude, position.longitude,
        view.denm.situation.eventType.causeCode,
    )  # fmt: skip


def spatem(view: Any) -> object:
    intersection = view.spat.intersections[0]
    movement = intersection.states[0]
    return (
        view.header.stationID, intersection.id.id, intersection.revision, movement.signalGroup,
        movement.state_time_speed[0].eventState,
    )  # fmt: skip


def mapem(view: Any) -> object:
    intersection = view.map.intersections[0]
    point = intersection.refPoint
    return view.header.stationID, intersection.id.id, point.lat, point.long, intersection.laneSet[0].laneID


def ivim(view: Any) -> object:
    mandatory = view.ivi.mandatory
    provider = mandatory.serviceProviderId
    return (
        view.header.stationID, mandatory.iviIdentificationNumber, mandatory.iviStatus, provider.countryCode,
        provider.providerIdentifier,
    )  # fmt: skip


def cpm(view: Any) -> object:
    management = view.cpm.cpmParameters.managementContainer
    position = management.referencePosition
    return (
        view.header.stationID, view.cpm.generationDeltaTime, management.stationType, position.latitude, position.longitude,
    )  # fmt: skip


READS: tuple[tuple[str, int, Callable[[Any], object]], ...] = (
    ("cam-1.4.1", 46, cam),
    ("cam-1.4.1", 143, cam),
    ("denm-1.3.1", 404, denm),
    ("spatem-2.1.1", 203, spatem),
    ("mapem-2.1.1", 536, mapem),
    ("ivim-2.1.1", 73, ivim),
    ("cpm-tr-2.1.1", 624, cpm),
)
"""Message, octets of the one of firmware/vectors.json, reader."""
