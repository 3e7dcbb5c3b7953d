"""Tables of captain.toml as frozen dataclasses, with bounds, defaults and meanings.

`make reference` generates the reference of options from these docstrings.
"""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from board.runtime.address import check_socket_path, mac_address
from board.runtime.describe import Check, Range
from board.runtime.errors import ConfigurationError
from board.runtime.toml import show

Port = Annotated[int, Range(0, 65535)]
Octet = Annotated[int, Range(0, 255)]
StationId = Annotated[int, Range(0, 4294967295)]
Priority = Annotated[int, Range(0, 7)]
Seconds = Annotated[float, Range(0.0, 86400.0)]
MOST_NAME = 64  # longest name in letters, as in DNS: it must fit into status, confirms and the console's first line


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
    from pps.chrony.feed import check_path

    try:
        check_path(path)
    except ConfigurationError as error:
        raise ConfigurationError(error.message.removeprefix("time.chrony: "), error.hint) from error


@dataclass(frozen=True)
class ConfiguredPosition:
    """Configured position, WGS84, in degrees.

    latitude   latitude; positive is north.
    longitude  longitude; positive is east.
    """

    latitude: Annotated[float, Range(-90.0, 90.0)]
    longitude: Annotated[float, Range(-180.0, 180.0)]


@dataclass(frozen=True)
class StationOptions:
    """[station]: identity of the station.

    name       name of the station in status and confirms, at most 64 letters.
    type       StationType of TS 102 894-2: 5 passenger car, 15 roadside unit, 0 unknown.
    is_mobile  itsGnIsMobile of EN 302 636-4-1: may the station move while it runs?
    profile    table of message types. `legacy` sends as older vehicleCAPTAIN boxes do. Both profiles receive the
               messages of both.
    id         own stationID, for messages in JSON without a header. Omitted: the last four octets of the MAC address.
    mac        own MAC address, such as "02:00:00:00:00:0b". Empty: a locally administered address, derived from
               machine, name and port.
    position   position of the station without a receiver, or before its first fix. With `is_mobile = false`, it is also
               used whenever the receiver has no fix.
    """

    name: Annotated[str, Check(_station_name)] = "captain"
    type: Annotated[int, Range(0, 31)] = 0
    is_mobile: bool = True
    profile: Literal["standard", "legacy"] = "standard"
    id: Annotated[int, Range(0, 2**32 - 1)] | None = None
    mac: Annotated[str, Check(_mac)] = ""
    position: ConfiguredPosition | None = None


@dataclass(frozen=True)
class EndpointOptions:
    """[endpoint]: sockets for user programs.

    address     address of the sockets. "0.0.0.0": all addresses of this host. Users are not authenticated.
    from_users  port for PUB sockets of users: messages to send.
    to_users    port for SUB sockets of users: received messages.
    pull        port for PUSH sockets of users: messages to send, with options.
    report      port for SUB sockets of users: status, confirms, indications.
    control     path of the Unix socket for commands such as `captain status`. Empty: a path in $XDG_RUNTIME_DIR,
                /run/captain or the temporary directory.
    strict      compare the type in the envelope with the PDU's messageID; if they differ, the message is dropped
                (`header-mismatch`).
    local_info  add own time and position to `raw.`, if they are known. Profile legacy never adds them.
    ipc_in      address for interface processes that deliver RawRxMessages, such as "ipc:///tmp/v2x/in/0". Empty: none.
    ipc_out     address for interface processes that send PDUs, such as "ipc:///tmp/v2x/out/0". Empty: none.
    """

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
    """[reception]: rules for received messages.

    unverified          treatment of signed packets. The station does not verify signatures yet, and nearly every
                        message on European roads is signed. `deliver`: users receive them, and the message on topic
                        `raw.` says unverifiable-pkt. `drop`: they are dropped, and counted as `secured`.
    gn_versions         accepted protocol versions of GeoNetworking. `[0, 1]` also accepts older stations.
    unknown_btp_port    treatment of messages to a BTP port that is not in the table of types. `deliver`: by messageID;
                        on topic `v2x..` if the PDU is shorter than an ITS PDU header. `drop`: they are dropped.
    duplicate_window_s  time in which a PDU that several interfaces receive is delivered only once. 0: every copy is
                        delivered.
    """

    unverified: Literal["drop", "deliver"] = "deliver"
    gn_versions: tuple[Annotated[int, Range(0, 15)], ...] = (1,)
    unknown_btp_port: Literal["drop", "deliver"] = "drop"
    duplicate_window_s: Seconds = 2.0


@dataclass(frozen=True)
class TimeOptions:
    """[time]: sources of time.

    receiver   interface with the GNSS receiver that drives the pulse input. Empty: the one in the board file, or the
               only interface with time marks.
    chrony     socket of chronyd (`refclock SOCK`) that gets each good pulse, such as "/run/chrony.captain.sock". Empty:
               none.
    tracking   ask chronyd for its state (`chronyc tracking`). Left out: true if `chrony` is set.
    leap_list  path of the system's leap-seconds.list. It is used until it expires or the receiver reports newer leap
               seconds. Empty: none.
    """

    receiver: str = ""
    chrony: Annotated[str, Check(_socket)] = ""
    tracking: bool | None = None
    leap_list: str = "/usr/share/zoneinfo/leap-seconds.list"


@dataclass(frozen=True)
class RecorderOptions:
    """[recorder]: a ring of recordings, written by a process of its own.

    folder     folder of the ring's files. The recorder creates it if its parent exists. A relative path is below
               STATE_DIRECTORY. Empty: no recording.
    size_mb    size of the ring. Frames kept for events may take the same space in addition.
    age_s      age at which frames are removed from the ring.
    keep_on    events whose surrounding frames are kept. `denm`: a DENM was sent or received; `loss`: ten frames were
               lost in a second; `gnss`: time by pulses was lost. `captain record --trigger` causes an event at any
               time.
    before_s   time before an event for which frames are kept.
    after_s    time after an event for which frames are kept.
    in_memory  accept a folder in memory (tmpfs), whose files are lost when the power fails.
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
    """Options of every interface, beside those of its driver.

    driver      kind of interface.
    queue       number of requests that may wait.
    rate_per_s  highest rate of sent messages. 0: no limit but the driver's.
    technology  name of the medium in status, such as "its-g5" for a udp or ethernet interface. Empty: the driver's.
    slot        slot of the board that holds the module. The station gives it power before it starts the driver, and
                power-cycles it if restarts of the driver do not help. Empty: none.
    """

    driver: str
    queue: Annotated[int, Range(1, 65536)] = 256
    rate_per_s: Annotated[float, Range(0.0, 100_000.0)] = 0.0
    technology: str = ""
    slot: str = ""


@dataclass(frozen=True)
class TypeConfig:
    """[[types]]: a new row of the table of message types, or a replacement of the row of a known messageID.

    number         messageID of the ITS PDU header.
    name           name in the envelope: a-z, 0-9 and _.
    btp_port       BTP port. Left out: the type is received, not sent.
    priority       priority in the queue: 0 leaves first. DENM has 0, CAM 2.
    lifetime_s     longest time in the queue, and the lifetime in the header of a single-hop broadcast.
    traffic_class  octet of the GeoNetworking common header; its TC ID is the DCC profile.
    """

    number: Octet
    name: Annotated[str, Check(_type_name)]
    btp_port: Port | None = None
    priority: Priority = 3
    lifetime_s: Seconds = 1.0
    traffic_class: Octet = 2


@dataclass(frozen=True)
class Span:
    """Limits of a number, both included. Raises ConfigurationError if min is above max.

    min  lowest value. Left out: no limit.
    max  highest value. Left out: no limit.
    """

    min: int | None = None
    max: int | None = None

    def __post_init__(self) -> None:
        if self.min is not None and self.max is not None and self.min > self.max:
            raise ConfigurationError(f"min {self.min} is more than max {self.max}", "set min to at most max")


@dataclass(frozen=True)
class PayloadMatch:
    """Octets of the PDU, compared under a mask.

    offset  position of the first octet to compare, counted from 0.
    value   expected octets, hexadecimal.
    mask    bits to compare, hexadecimal, as long as value. Empty: all.

    Raises ConfigurationError if value is empty, if value or mask is not hexadecimal, or if their lengths differ.
    """

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
    """Condition: an interface has recently heard at least `count` stations.

    interface  name of the interface.
    within_s   time since the last reception from a station, at most.
    count      least number of stations.
    rssi_dbm   least RSSI of each of these stations. Left out: any.
    """

    interface: str
    within_s: Seconds = 5.0
    count: Annotated[int, Range(0, 4096)] = 1
    rssi_dbm: int | None = None


@dataclass(frozen=True)
class PositionMatch:
    """Condition: the own position is inside a circle.

    latitude   latitude of the centre in degrees, WGS84.
    longitude  longitude of the centre in degrees, WGS84.
    radius_m   radius of the circle.
    """

    latitude: Annotated[float, Range(-90.0, 90.0)]
    longitude: Annotated[float, Range(-180.0, 180.0)]
    radius_m: Annotated[float, Range(0.0, 1e7)]


@dataclass(frozen=True)
class Match:
    """Conditions of a row of the policy, which must all be true. A row without conditions matches every message.

    type           the message has one of these types.
    station        the stationID in the ITS PDU header is one of these.
    size           the length of the PDU in octets is in this range: `{ min = 100, max = 300 }`.
    btp_port       the BTP port is one of these.
    traffic_class  the traffic class is one of these.
    area           `none`: the message is a single-hop broadcast; `any`: it is a GeoBroadcast; `inside`: it is one whose
                   destination area contains the own position; `outside`: it is one whose area does not.
    payload        the PDU contains these octets: `[{ offset = 6, value = "80", mask = "f0" }]`.
    link_up        the link of each of these interfaces is up.
    link_down      the link of each of these interfaces is down.
    bearer         `true`: a mobile network is up; `false`: no mobile network is up.
    neighbours     at least `count` stations were heard recently:
                   `{ interface = "g5", within_s = 5.0, count = 1, rssi_dbm = -85 }`.
    no_neighbours  fewer than `count` stations were heard recently; same keys as `neighbours`.
    position       the own position is in this circle: `{ latitude = 48.76, longitude = 11.43, radius_m = 500 }`.
    implausible    the message is implausible for one of these reasons; `any`: for any reason. Such a row matches only
                   received messages. Its `interfaces` are `[]` (drop, as `implausible`) or `["*"]` (deliver).
    """

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
    position: PositionMatch | None = None
    implausible: tuple[Literal["any", "position", "time", "source", "sequence", "own-address"], ...] = ()


@dataclass(frozen=True)
class PolicyRow:
    """[[policy]]: the first row that matches a message determines by which interfaces it leaves.

    A message without a matching row leaves by every interface that is up. A row with match.implausible is for received
    messages.

    name           name of the row in status.
    match          conditions.
    interfaces     interfaces that send the message. `["*"]`: all that transmit; `[]`: it is dropped (`policy`).
    fallback       interfaces to use while the links of all of `interfaces` are down.
    priority       priority in the queue, instead of the type's. 0 leaves first.
    lifetime_s     lifetime, instead of the type's.
    rate_per_s     highest rate of messages of this row; further messages are dropped (`rate-limit`). 0: no limit.
    traffic_class  traffic class, instead of the type's.
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
    """All tables of captain.toml. The tables of interfaces are checked later, with the options of their drivers."""

    station: StationOptions = StationOptions()
    endpoint: EndpointOptions = EndpointOptions()
    reception: ReceptionOptions = ReceptionOptions()
    time: TimeOptions = TimeOptions()
    recorder: RecorderOptions = RecorderOptions()
    interfaces: dict[str, dict[str, Any]] = field(default_factory=dict)
    types: tuple[TypeConfig, ...] = ()
    policy: tuple[PolicyRow, ...] = ()
