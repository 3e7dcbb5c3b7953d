"""What travels: indications from an interface, requests to it, confirms about a request (words of EN 302 636)."""

from enum import Enum, IntEnum
from typing import NamedTuple

from board.time import TimeQuality
from drivers.implausible import Implausible
from drivers.reason import Reason

ITS_HEADER = 6  # octets: protocolVersion, messageID, stationID (TS 102 894-2, ItsPduHeader)
MAX_PDU = 1500  # octets, payloadString of RawRxMessage


class Position(NamedTuple):
    """A place in 1e-7 degree, WGS84."""

    latitude: int = 0
    longitude: int = 0


class Ego(NamedTuple):
    """The station's own state as far as it is known: what a GeoNetworking position vector needs.

    its_ms     ITS time, milliseconds since 2004-01-01.
    position   WGS84.
    is_known   whether position is more than a default.
    speed      in 0.01 m/s, signed. heading in 0.1 degree from north.
    is_accurate  whether position is within itsGnPaiInterval / 2 of the truth; False: nobody knows how exact it is.
    """

    its_ms: int
    position: Position
    is_known: bool
    speed: int = 0
    heading: int = 0
    is_accurate: bool = True


class Shape(IntEnum):
    """Form of a destination area, numbered as AreaTypeInfo.type of RawRxMessage."""

    CIRCLE = 0
    RECTANGLE = 1
    ELLIPSE = 2


class Area(NamedTuple):
    """A destination area (EN 302 931): distances in metres, angle of the long axis in degrees from north."""

    shape: Shape
    centre: Position
    distance_a: int
    distance_b: int = 0
    angle: int = 0


class SecurityStatus(IntEnum):
    """RxSecurity.status of RawRxMessage."""

    NONE = 0
    INVALID_FMT = 1
    VERIFIED_PKT = 2
    UNVERIFIABLE_PKT = 3


class Security(NamedTuple):
    """What is known of a packet's signature."""

    status: SecurityStatus = SecurityStatus.NONE
    its_aid: int = 0
    ssp: bytes = b""  # at most 32 octets


NOT_SECURED = Security()
NO_MAC = bytes(6)


class RxInfo(NamedTuple):
    """What an interface knows of a received PDU beside its octets; what it does not know keeps its default."""

    btp_port: int | None = None
    rssi_dbm: int | None = None
    data_rate: int = 0  # in 500 kbit/s
    traffic_class: int = 0
    hop_limit: int = 0  # remaining
    security: Security = NOT_SECURED
    position: Position = Position()  # of the sender
    area: Area | None = None
    source_mac: bytes = NO_MAC
    transport: str = ""  # shb, gbc, tsb, guc, gac, beacon; empty where there is no GeoNetworking
    source: str = ""  # the client of a broker that sent it, where the broker's messages say so
    implausible: tuple[Implausible, ...] = ()  # reasons to doubt it


NO_RX_INFO = RxInfo()


class MessageType(NamedTuple):
    """A row of the table of message types.

    name      as in the envelope; empty for an id without a name (`v2x..`).
    number    messageID, octet 1 of the PDU.
    btp_port  that it leaves by in the profile in use; None where it has none.
    priority  0 leaves first; what the policy's default gives it.
    row       of the table of types, and of its counters; unknown ids share the last.
    lifetime  seconds after which it is too old to leave, unless the policy or the user says otherwise; in the
              header of its single hop broadcast.
    traffic_class  octet of the GeoNetworking common header, under the same condition.
    """

    name: str
    number: int
    btp_port: int | None
    priority: int
    row: int
    lifetime: float = 1.0
    traffic_class: int = 2


UNKNOWN_TIME = TimeQuality()


class Indication(NamedTuple):
    """A PDU that came from an interface.

    quality  of received_ns as a time: of the second in which it came.
    """

    kind: MessageType
    pdu: bytes
    interface: str
    received_ns: int  # Unix time, from the kernel where it stamps
    monotonic: float  # the loop's clock, when the station took it
    rx: RxInfo
    quality: TimeQuality = UNKNOWN_TIME


class Request(NamedTuple):
    """A PDU that goes to interfaces; one object, whatever number of interfaces it leaves by.

    number         counts requests since the start.
    accepted       the loop's clock when the station took it.
    deadline       the loop's clock after which it must not leave.
    priority       0 leaves first.
    traffic_class  octet of the GeoNetworking common header.
    area           makes it a GeoBroadcast; None is a single hop broadcast.
    hop_limit      of a GeoBroadcast.
    label          the user's own id for confirms; empty without one.
    """

    number: int
    kind: MessageType
    pdu: bytes
    btp_port: int
    accepted: float
    deadline: float
    priority: int
    traffic_class: int
    area: Area | None = None
    hop_limit: int = 1
    label: str = ""


class Outcome(Enum):
    """What became of a request, as in confirm messages."""

    ACCEPTED = "accepted"  # by the station; the interfaces it goes to are named
    SENT = "sent"  # by this interface
    REFUSED = "refused"  # by the station, before any interface
    DROPPED = "dropped"  # by this interface's queue or driver


class Confirm(NamedTuple):
    """The answer to a request: one when it is accepted or refused, then one from each interface."""

    request: Request
    outcome: Outcome
    interface: str = ""
    reason: Reason | None = None
    queue_s: float = 0.0  # from accepted to handed to the driver
    send_s: float = 0.0  # from there until it had left
    detail: str = ""  # what the reason does not say
