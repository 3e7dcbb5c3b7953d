"""Options of a request: the JSON object in the third frame to the PULL socket."""

import json
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from board.runtime import describe
from board.runtime.describe import Range
from board.runtime.errors import ConfigurationError, RequestError
from drivers.message import Area, Position, Shape

MAX_FRAME = 4096  # octets; an object with the longest value of each option has less than 500


@dataclass(frozen=True)
class AreaOptions:
    """Destination area of a GeoBroadcast (EN 302 931), WGS84.

    shape       shape of the area.
    latitude    latitude of its centre in degrees.
    longitude   longitude of its centre in degrees.
    distance_a  radius of a circle in metres; else half of the length.
    distance_b  half of the width of a rectangle or an ellipse in metres. Omit it for a circle.
    angle       azimuth of the long axis in degrees, clockwise from north. Omit it for a circle.

    Raises ConfigurationError for a circle with distance_b or angle, and for another shape without distance_b.
    """

    shape: Literal["circle", "rectangle", "ellipse"]
    latitude: Annotated[float, Range(-90.0, 90.0)]
    longitude: Annotated[float, Range(-180.0, 180.0)]
    distance_a: Annotated[int, Range(1, 65535)]
    distance_b: Annotated[int, Range(0, 65535)] = 0
    angle: Annotated[int, Range(0, 360)] = 0

    def __post_init__(self) -> None:
        if self.shape == "circle" and (self.distance_b or self.angle):
            raise ConfigurationError("a circle has neither distance_b nor angle", "leave them out")
        if self.shape != "circle" and not self.distance_b:
            raise ConfigurationError(f"a {self.shape} needs distance_b", "give it in metres")

    def area(self) -> Area:
        centre = Position(round(self.latitude * 1e7), round(self.longitude * 1e7))
        return Area(Shape[self.shape.upper()], centre, self.distance_a, self.distance_b, self.angle)


@dataclass(frozen=True)
class RequestOptions:
    """Options of one message. The policy determines those that are omitted.

    label          text that the confirms of the message return.
    form           form of the second frame: `octets` is a PDU, `json` is a JSON object as `captain decode --json`
                   prints, `plain` is one with SI units.
    interfaces     interfaces that replace `interfaces` and `fallback` of the policy's row; its other options still
                   apply. `["*"]`: all interfaces that transmit.
    btp_port       destination port that replaces the one of the message type.
    traffic_class  octet of the GeoNetworking common header.
    priority       priority in the queue: 0 leaves first.
    lifetime_s     seconds after which a waiting message is dropped.
    hop_limit      hop limit of a GeoBroadcast; only with area.
    area           destination area, which makes the message a GeoBroadcast. Omitted: single-hop broadcast.

    Raises ConfigurationError for a hop_limit without area.
    """

    label: str = ""
    form: Literal["octets", "json", "plain"] = "octets"
    interfaces: tuple[str, ...] | None = None
    btp_port: Annotated[int, Range(0, 65535)] | None = None
    traffic_class: Annotated[int, Range(0, 255)] | None = None
    priority: Annotated[int, Range(0, 7)] | None = None
    lifetime_s: Annotated[float, Range(above=0.0, max=86400.0)] | None = None
    hop_limit: Annotated[int, Range(1, 255)] | None = None
    area: AreaOptions | None = None

    def __post_init__(self) -> None:
        if self.hop_limit is not None and self.area is None:
            raise ConfigurationError("hop_limit is that of a GeoBroadcast", "give an area, or leave it out")


NO_OPTIONS = RequestOptions()


class Parsed(NamedTuple):
    """Options of a message, with their area converted to drivers.message.Area."""

    options: RequestOptions
    area: Area | None


NOTHING_ASKED = Parsed(NO_OPTIONS, None)


def label_of(frame: bytes) -> str:
    """Return the label of an invalid options frame, for the confirm of its refusal; empty if it has none."""
    try:
        table = json.loads(frame[:MAX_FRAME])
    except (ValueError, RecursionError):
        return ""
    label = table.get("label") if isinstance(table, dict) else None
    return label if isinstance(label, str) else ""


def parse(frame: bytes) -> Parsed:
    """Parse an options frame. Raises RequestError that names each invalid value with its key."""
    if len(frame) > MAX_FRAME:
        raise RequestError(f"options: {len(frame)} octets are more than the {MAX_FRAME} that are read")
    try:
        table = json.loads(frame)
    except (ValueError, RecursionError) as error:
        raise RequestError(f"options: not JSON: {error}", "the third frame is one JSON object") from error
    if not isinstance(table, dict):
        raise RequestError(f"options: {type(table).__name__} is not an object", "the third frame is one JSON object")
    try:
        options = describe.read(RequestOptions, table, "options")
    except ConfigurationError as error:
        raise RequestError(str(error)) from error
    return Parsed(options, options.area.area() if options.area else None)
