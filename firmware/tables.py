"""The tables of captain.toml as frozen dataclasses: what may be written in it, with bounds and defaults."""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from board.address import check_socket_path, mac_address
from board.describe import Check, Range
from board.errors import ConfigurationError
from board.toml import show

Port = Annotated[int, Range(0, 65535)]
Octet = Annotated[int, Range(0, 255)]
StationId = Annotated[int, Range(0, 4294967295)]
Priority = Annotated[int, Range(0, 7)]
Seconds = Annotated[float, Range(0.0, 86400.0)]
MOST_NAME = 64  # letters: as a name of DNS; status, confirms and the console's first line have it


def _station_name(text: str) -> None:
    if len(text) > MOST_NAME:
        raise ConfigurationError(f"{show(text)} has {len(text)} letters", f"give at most {MOST_NAME}")
    if not text.strip() or not text.isprintable():
        raise ConfigurationError(f"{show(text)} must have letters and nothing that does not print", "correct it")


def _mac(text: str) -> None:
    if text:
        mac_address(text)


def _type_name(text: str) -> None:
    if not text.replace("_", "a").isalnum() or text != text.lower() or not text.isascii():
        hint = "use only a-z, 0-9 and _; the name becomes part of the topic v2x.<name>."
        raise ConfigurationError(f"invalid type name {show(text)}", hint)


def _ipc(address: str) -> None:
    path = address.removeprefix("ipc://")
    if address and path in ("", address):
        raise ConfigurationError(f"invalid path {show(address)}", "for example ipc:///run/captain/ipc")
    check_socket_path(path)


def _socket(path: str) -> None:
    if not path:
        return
    from pps.chrony import check_path

    try:
        check_path(path)
    except ConfigurationError as error:
        raise ConfigurationError(error.message.removeprefix("time.chrony: "), error.hint) from error


@dataclass(frozen=True)
class Place:
    """A position in degrees, WGS84."""

    latitude: Annotated[float, Range(-90.0, 90.0)]
    longitude: Annotated[float, Range(-180.0, 180.0)]


@dataclass(frozen=True)
class StationOptions:
    """[station]: who this is.

    type       StationType of TS 102 894-2: 5 passenger car, 15 roadside unit, 0 unknown.
    is_mobile  itsGnIsMobile of EN 302 636-4-1: whether it may move while it runs.
    mac        own address; an empty one is made from host, name and port, locally administered.
    """

    name: Annotated[str, Check(_station_name)] = "captain"
    type: Annotated[int, Range(0, 31)] = 0
    is_mobile: bool = True
    profile: Literal["standard", "legacy"] = "standard"
    mac: Annotated[str, Check(_mac)] = ""
    position: Place | None = None


@dataclass(frozen=True)
class EndpointOptions:
    """[endpoint]: where user programs connect. An ipc_ address is off when empty."""

    address: str = "127.0.0.1"
    from_users: Port = 5555
    to_users: Port = 5556
    pull: Port = 5557
    report: Port = 5558
    control: Annotated[str, Check(check_socket_path)] = ""
    strict: bool = False
    local_info: bool = True
    ipc_in: Annotated[str, Check(_ipc)] = ""
    ipc_out: Annotated[str, Check(_ipc)] = ""


@dataclass(frozen=True)
class ReceptionOptions:
    """[reception]: what is passed on to users, and what is dropped with its reason.

    unverified  signed packets: nearly every message on European roads is signed, and signatures are not verified yet.
    """

    unverified: Literal["drop", "deliver"] = "deliver"
    gn_versions: tuple[Annotated[int, Range(0, 15)], ...] = (1,)
    unknown_btp_port: Literal["drop", "deliver"] = "drop"
    duplicate_window_s: Seconds = 2.0


@dataclass(frozen=True)
class TimeOptions:
    """[time]: whose word the time is, and who else is told.

    receiver   interface whose receiver drives the pulse; empty: that of the board file, or the only one that
               announces pulses.
    chrony     socket of chronyd (`refclock SOCK`), which is given each good pulse; empty: none.
    tracking   whether chronyd is asked how it does; left out: where chrony is given.
    leap_list  leap-seconds.list of the system, used until it expires and a receiver knows better; empty: none.
    """

    receiver: str = ""
    chrony: Annotated[str, Check(_socket)] = ""
    tracking: bool | None = None
    leap_list: str = "/usr/share/zoneinfo/leap-seconds.list"


@dataclass(frozen=True)
class RecorderOptions:
    """[recorder]: a ring of recordings, which a process of its own writes.

    folder     of its files, made where the one above is there; one that does not begin with / is in STATE_DIRECTORY;
               empty: nothing is recorded.
    size_mb    of the ring, and again of what is kept.
    age_s      of the ring.
    keep_on    events of which before_s and after_s seconds are kept: a DENM that passed, ten losses within a second,
               time by pulses that is lost. An operator may always ask.
    in_memory  whether the folder may be in memory, where a cut of power takes everything.
    """

    folder: str = ""
    size_mb: Annotated[int, Range(1, 1_048_576)] = 256
    age_s: Annotated[float, Range(1.0, 31_536_000.0)] = 3600.0
    keep_on: tuple[Literal["denm", "loss", "gnss"], ...] = ("denm", "loss", "gnss")
    before_s: Seconds = 30.0
    after_s: Seconds = 10.0
    in_memory: bool = False


@dataclass(frozen=True)
class QueueOptions:
    """The options that every [interfaces.<name>] has beside its driver's.

    queue       requests that may wait for it.
    rate_per_s  its pace; 0 is as fast as the driver takes them.
    technology  what status calls its medium, where the driver cannot know: its-g5 behind a udp or ethernet interface.
    slot        of the board that its module sits in: it gets power before the driver is started, and is taken from it
                and given again where starting alone does not help; empty: none, the driver is tried for ever.
    """

    driver: str
    queue: Annotated[int, Range(1, 65536)] = 256
    rate_per_s: Annotated[float, Range(0.0, 100_000.0)] = 0.0
    technology: str = ""
    slot: str = ""


@dataclass(frozen=True)
class TypeConfig:
    """[[types]]: a further or changed row of the table of message types."""

    number: Octet
    name: Annotated[str, Check(_type_name)]
    btp_port: Port | None = None
    priority: Priority = 3
    lifetime_s: Seconds = 1.0
    traffic_class: Octet = 2


@dataclass(frozen=True)
class Span:
    """Limits of a number, both included; one left out is open."""

    min: int | None = None
    max: int | None = None

    def __post_init__(self) -> None:
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ConfigurationError(f"min {self.min} is more than max {self.max}", "set min to at most max")


@dataclass(frozen=True)
class PayloadMatch:
    """Octets of the PDU from offset on, hexadecimal; only the bits of the mask are compared."""

    offset: Annotated[int, Range(0, 1499)]
    value: str
    mask: str = ""

    def __post_init__(self) -> None:
        try:
            value, mask = bytes.fromhex(self.value), bytes.fromhex(self.mask)
        except ValueError as error:
            what = f"value {self.value!r} and mask {self.mask!r} must be hexadecimal octets"
            raise ConfigurationError(what) from error
        if not value:
            raise ConfigurationError("value is empty", "give the octets to compare")
        if mask and len(mask) != len(value):
            raise ConfigurationError(
                f"mask has {len(mask)} octets and value {len(value)}", "give value and mask the same length"
            )


@dataclass(frozen=True)
class NeighbourMatch:
    """At least `count` stations heard on an interface in the last within_s seconds, each at rssi_dbm or better."""

    interface: str
    within_s: Seconds = 5.0
    count: Annotated[int, Range(0, 4096)] = 1
    rssi_dbm: int | None = None


@dataclass(frozen=True)
class PlaceMatch:
    """Own position inside a circle."""

    latitude: Annotated[float, Range(-90.0, 90.0)]
    longitude: Annotated[float, Range(-180.0, 180.0)]
    radius_m: Annotated[float, Range(0.0, 1e7)]


@dataclass(frozen=True)
class Match:
    """When a row of the policy applies: all that is given must hold; an empty one always does."""

    type: tuple[str, ...] = ()
    station: tuple[StationId, ...] = ()
    size: Span = Span()
    btp_port: tuple[Port, ...] = ()
    traffic_class: tuple[Octet, ...] = ()
    area: Literal["", "none", "any", "inside", "outside"] = ""
    payload: tuple[PayloadMatch, ...] = ()
    link_up: tuple[str, ...] = ()
    link_down: tuple[str, ...] = ()
    bearer: bool | None = None
    neighbours: NeighbourMatch | None = None
    no_neighbours: NeighbourMatch | None = None
    position: PlaceMatch | None = None
    implausible: tuple[Literal["any", "position", "time", "source", "sequence", "own-address"], ...] = ()


@dataclass(frozen=True)
class PolicyRow:
    """[[policy]]: the first row whose match applies says how a message leaves.

    A row with match.implausible is for received messages: those with one of these reasons.

    interfaces     that it leaves by; "*" is each that transmits; none drops it. Of a received one: none drops it.
    fallback       those that it leaves by when none of them has its link up.
    priority, lifetime_s, traffic_class  in place of the type's own.
    rate_per_s     of messages that this row lets through; 0 is any.
    """

    name: str = ""
    match: Match = Match()
    interfaces: tuple[str, ...] = ("*",)
    fallback: tuple[str, ...] = ()
    priority: Priority | None = None
    lifetime_s: Seconds | None = None
    rate_per_s: Annotated[float, Range(0.0, 100_000.0)] = 0.0
    traffic_class: Octet | None = None


@dataclass(frozen=True)
class Tables:
    """The tables of captain.toml; interfaces are read once more, with their drivers' options."""

    station: StationOptions = StationOptions()
    endpoint: EndpointOptions = EndpointOptions()
    reception: ReceptionOptions = ReceptionOptions()
    time: TimeOptions = TimeOptions()
    recorder: RecorderOptions = RecorderOptions()
    interfaces: dict[str, dict[str, Any]] = field(default_factory=dict)
    types: tuple[TypeConfig, ...] = ()
    policy: tuple[PolicyRow, ...] = ()
