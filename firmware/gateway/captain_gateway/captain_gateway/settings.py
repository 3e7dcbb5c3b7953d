"""What can be chosen: every parameter with its default, what it means, and how its value is read."""

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
    """A parameter. is_fixed: read at the start, and never changed."""

    default: object
    meaning: str
    read: Read
    is_fixed: bool = False


# -- parameters

PORT, PORT_IN_USE = integer(0, 65535), integer(1, 65535)
USUAL = [kind.name for kind in KINDS.values() if kind.is_usual]

GATEWAY: dict[str, Option] = {
    "station.host": Option("127.0.0.1", "where the station is: a name or an address", host, True),
    "station.to_users": Option(5556, "its port that messages come from", PORT_IN_USE, True),
    "station.pull": Option(5557, "its port that takes messages without loss; 0: it has none", PORT, True),
    "station.from_users": Option(5555, "its port that takes messages where there is no pull", PORT_IN_USE, True),
    "station.report": Option(5558, "its port that tells of itself, interfaces and confirms; 0: it has none", PORT, True),
    "profile": Option("etsi_its", f"whose message packages: {' or '.join(PROFILES)}", choice(*PROFILES), True),
    "lists": Option(False, "with v2x_msgs: whether topics carry lists of one message, CAMList, as those of v2x_gw", boolean, True),
    "handlers": Option(USUAL, "types that have topics; those whose package is not installed are left out", kinds, True),
    "topics.received": Option("{type}/received", "what has been received", template, True),
    "topics.transmitted": Option("{type}/transmitted", "what is to be sent", template, True),
    "topics.metadata": Option("{type}/received/metadata", "what is known of each received", template, True),
    "frames.map": Option("map", "frame of own pose and transform", text, True),
    "frames.station": Option("captain", "frame of the station", text, True),
    "own.origin": Option([], "[latitude, longitude, altitude_m] of the map's origin; empty: the first own position", place, True),
    "own.transform": Option(True, "whether own position is a transform on /tf as well", boolean, True),
    "confirms": Option(True, "whether the station is asked what becomes of each message", boolean, True),
    "station_id": Option(0, "put into the header of every message that is sent; 0: they keep theirs", integer(0, 0xFFFFFFFF)),
    "log.throttle_s": Option(1.0, "the same complaint is logged once in so many seconds", number(0.0, 3600.0)),
}  # fmt: skip

HANDLER: dict[str, Option] = {
    "edition": Option("", "of the standard, as `cam-1.4.1`; empty: the default", text, True),
    "topic": Option("", "what stands for {type} in topics; empty: the name of the handler", text, True),
    "receive.active": Option(True, "whether received ones are published", boolean),
    "receive.stations": Option([], "of these stationIDs alone; empty: of all", stations),
    "receive.not_stations": Option([], "not of these stationIDs", stations),
    "receive.area": Option([], "[radius_m] around own position or [latitude, longitude, radius_m]; empty: anywhere", circle),
    "receive.max_age_s": Option(0.0, "older ones, by the time in them, are left out; 0: none are", number(0.0, 86400.0)),
    "transmit.active": Option(True, "whether published ones are sent", boolean),
    "transmit.rate_hz": Option(0.0, "0: at once; else so many sendings a second", number(0.0, FASTEST_HZ)),
    "transmit.buffer": Option("latest", "with a rate, what waits: the latest of each thing, or all", choice("latest", "all")),
    "transmit.depth": Option(10, "how many may wait; the oldest goes", integer(1, 10_000)),
    "transmit.repeat_s": Option(0.0, "with a rate and `latest`: sent again for so long, until there is a newer one", number(0.0, 86400.0)),
    "transmit.interfaces": Option([], "of the station; empty: by its policy", texts),
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
        """What they ask of the station for each message: keys of its options."""
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
    """Of the values of HANDLER by name; all have been checked."""
    return Receive(**_read("receive.", values))


def transmit(values: Mapping[str, object]) -> Transmit:
    """Of the values of HANDLER by name; all have been checked."""
    return Transmit(**_read("transmit.", values))


def _read(prefix: str, values: Mapping[str, object]) -> dict[str, Any]:
    return {
        name.removeprefix(prefix): option.read(values[name])
        for name, option in HANDLER.items()
        if name.startswith(prefix)
    }
