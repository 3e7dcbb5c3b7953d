"""Parameters of the gateway: defaults, descriptions and parsers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from .handlers import KINDS
from .values import (
    Circle,
    Read,
    area,
    boolean,
    choice,
    circle,
    host,
    integer,
    kinds,
    number,
    place,
    stations,
    template,
    text,
    texts,
)

PROFILES = ("etsi_its", "v2x_msgs")
FASTEST_HZ = 1000.0


class Option(NamedTuple):
    """A parameter. is_fixed: it is read at the start and cannot be changed later."""

    default: object
    meaning: str
    read: Read
    is_fixed: bool = False


# -- parameters

PORT, PORT_IN_USE = integer(0, 65535), integer(1, 65535)
USUAL = [kind.name for kind in KINDS.values() if kind.is_usual]

GATEWAY: dict[str, Option] = {
    "station.host": Option("127.0.0.1", "host of the station: a name or an address", host, True),
    "station.to_users": Option(5556, "port of received messages", PORT_IN_USE, True),
    "station.pull": Option(5557, "port that takes messages without loss; 0: not available", PORT, True),
    "station.from_users": Option(5555, "port that takes messages if station.pull is 0", PORT_IN_USE, True),
    "station.report": Option(5558, "port of reports, indications and confirms; 0: not available", PORT, True),
    "profile": Option("etsi_its", f"message packages: {' or '.join(PROFILES)}", choice(*PROFILES), True),
    "lists": Option(False, "with v2x_msgs: topics carry lists of one message (CAMList), like those of v2x_gw", boolean, True),
    "handlers": Option(USUAL, "types that have topics; types without an installed package are left out", kinds, True),
    "topics.received": Option("{type}/received", "topic of received messages", template, True),
    "topics.transmitted": Option("{type}/transmitted", "topic of messages to send", template, True),
    "topics.metadata": Option("{type}/received/metadata", "topic of the metadata of received messages", template, True),
    "frames.map": Option("map", "frame of own pose and transform", text, True),
    "frames.station": Option("captain", "frame of the station", text, True),
    "own.origin": Option([], "[latitude, longitude, altitude_m] of the map's origin; empty: the first own position", place, True),
    "own.transform": Option(True, "publish own position as a transform on /tf, too", boolean, True),
    "confirms": Option(True, "request confirms of each sent message", boolean, True),
    "station_id": Option(0, "stationID of sent messages; 0: theirs stays", integer(0, 0xFFFFFFFF)),
    "log.throttle_s": Option(1.0, "seconds between two log lines of the same complaint", number(0.0, 3600.0)),
}  # fmt: skip

HANDLER: dict[str, Option] = {
    "edition": Option("", "edition of the standard, such as `cam-1.4.1`; empty: the default", text, True),
    "topic": Option("", "replacement of {type} in topics; empty: the name of the handler", text, True),
    "receive.active": Option(True, "publish received messages", boolean),
    "receive.stations": Option([], "publish only these stationIDs; empty: all", stations),
    "receive.not_stations": Option([], "do not publish these stationIDs", stations),
    "receive.area": Option([], "[radius_m] around own position or [latitude, longitude, radius_m]; empty: anywhere", circle),
    "receive.max_age_s": Option(0.0, "do not publish older messages, by the time in them; 0: publish all", number(0.0, 86400.0)),
    "transmit.active": Option(True, "send published messages", boolean),
    "transmit.rate_hz": Option(0.0, "messages sent per second; 0: at once", number(0.0, FASTEST_HZ)),
    "transmit.buffer": Option("latest", "with a rate: keep the latest message of each station, event or sign, or all", choice("latest", "all")),
    "transmit.depth": Option(10, "length of the queue; the oldest is dropped", integer(1, 10_000)),
    "transmit.repeat_s": Option(0.0, "with a rate and `latest`: repeat a message for this time, until a newer one comes", number(0.0, 86400.0)),
    "transmit.interfaces": Option([], "interfaces of the station; empty: by its policy", texts),
    "transmit.btp_port": Option(0, "0: that of the type", PORT),
    "transmit.traffic_class": Option(-1, "-1: by the station's policy", integer(-1, 255)),
    "transmit.priority": Option(-1, "0 first, 7 last; -1: by the station's policy", integer(-1, 7)),
    "transmit.lifetime_s": Option(0.0, "0: by the station's policy", number(0.0, 86400.0)),
    "transmit.hop_limit": Option(0, "with an area; 0: by the station's policy", integer(0, 255)),
    "transmit.area": Option("", "`circle LATITUDE LONGITUDE RADIUS`: makes it a GeoBroadcast; empty: a single hop", area),
}  # fmt: skip


@dataclass(frozen=True)
class Receive:
    """Parameters receive.* of a handler."""

    active: bool
    stations: frozenset[int]
    not_stations: frozenset[int]
    area: Circle | None
    max_age_s: float


@dataclass(frozen=True)
class Transmit:
    """Parameters transmit.* of a handler."""

    active: bool
    rate_hz: float
    buffer: Literal["latest", "all"]
    depth: int
    repeat_s: float
    interfaces: tuple[str, ...]
    btp_port: int
    traffic_class: int
    priority: int
    lifetime_s: float
    hop_limit: int
    area: dict[str, object] | None

    def options(self) -> dict[str, object]:
        """Return the request options for the station, as set by the parameters."""
        asked: dict[str, object] = {}
        if self.interfaces:
            asked["interfaces"] = list(self.interfaces)
        if self.btp_port:
            asked["btp_port"] = self.btp_port
        if self.traffic_class >= 0:
            asked["traffic_class"] = self.traffic_class
        if self.priority >= 0:
            asked["priority"] = self.priority
        if self.lifetime_s:
            asked["lifetime_s"] = self.lifetime_s
        if self.area:
            asked["area"] = self.area
            if self.hop_limit:
                asked["hop_limit"] = self.hop_limit
        return asked


def receive(values: Mapping[str, object]) -> Receive:
    """Return the settings receive.* of a handler. values: of all parameters of HANDLER, by name; they must be valid."""
    return Receive(**_read("receive.", values))


def transmit(values: Mapping[str, object]) -> Transmit:
    """Return the settings transmit.* of a handler.

    values: of all parameters of HANDLER, by name; they must be valid.
    """
    return Transmit(**_read("transmit.", values))


def _read(prefix: str, values: Mapping[str, object]) -> dict[str, Any]:
    return {
        name.removeprefix(prefix): option.read(values[name])
        for name, option in HANDLER.items()
        if name.startswith(prefix)
    }
