"""The third frame of a message to the PULL socket: what its user wants beyond the envelope, as a JSON object."""

import json
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from board import describe
from board.describe import Range
from board.errors import ConfigurationError, RequestError
from drivers.message import Area, Position, Shape

MAX_FRAME = 4096  # octets: all options with their longest values stay below 500


@dataclass(frozen=True)
class AreaOptions:
    """A destination area (EN 302 931): degrees WGS84, metres, degrees from north.

    distance_b  of a rectangle and an ellipse; a circle has none, and no angle.
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
            raise ConfigurationError(f"nobody can be in a {self.shape} without distance_b", "give it in metres")

    def area(self) -> Area:
        centre = Position(round(self.latitude * 1e7), round(self.longitude * 1e7))
        return Area(Shape[self.shape.upper()], centre, self.distance_a, self.distance_b, self.angle)


@dataclass(frozen=True)
class RequestOptions:
    """What a user may ask for one message; what is absent is left to the policy."""

    label: str = ""
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
    """Options and the area made of them, once."""

    options: RequestOptions
    area: Area | None


NOTHING_ASKED = Parsed(NO_OPTIONS, None)


def label_of(frame: bytes) -> str:
    """The label in an options frame that is wrong otherwise, so that its user knows which; empty without one."""
    try:
        table = json.loads(frame[:MAX_FRAME])
    except (ValueError, RecursionError):
        return ""
    label = table.get("label") if isinstance(table, dict) else None
    return label if isinstance(label, str) else ""


def parse(frame: bytes) -> Parsed:
    """Read the options frame. Raises RequestError that names each mistake with its place."""
    if len(frame) > MAX_FRAME:
        raise RequestError(f"options: {len(frame)} octets are more than the {MAX_FRAME} that are read")
    try:
        table = json.loads(frame)
    except (ValueError, RecursionError) as error:
        raise RequestError(f"options: not JSON: {error}", "the third frame is one JSON object") from error
    if not isinstance(table, dict):
        raise RequestError(f"options: {type(table).__name__} is no object", "the third frame is one JSON object")
    try:
        options = describe.read(RequestOptions, table, "options")
    except ConfigurationError as error:
        raise RequestError(str(error)) from error
    return Parsed(options, options.area.area() if options.area else None)
