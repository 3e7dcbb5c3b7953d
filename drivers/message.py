"""Messages of the station: indications, requests and confirms (words of EN 302 636)."""

from collections.abc import Sequence
from enum import Enum, IntEnum
from typing import NamedTuple

from board.time.scales import TimeQuality
from drivers.implausible import Implausible
from drivers.reason import Reason

ITS_HEADER = 6  # octets of the ITS PDU header: protocolVersion, messageID, stationID (TS 102 894-2, ItsPduHeader)
MAX_PDU = 1500  # octets of the longest PDU: limit of payloadString in RawRxMessage


class Position(NamedTuple):
    """A position in 1e-7 degree, WGS84."""

    latitude: int = 0
    longitude: int = 0


class Ego(NamedTuple):
    """Time, position and movement of the own station: the content of a GeoNetworking position vector.

    its_ms       ITS time: milliseconds since 2004-01-01.
    position     position in WGS84.
    is_known     True if the position was measured or configured. False if it is a default, or if ITS time is unknown.
    speed        speed in 0.01 m/s, signed.
    heading      heading in 0.1 degree, clockwise from north.
    is_accurate  True if the position is within itsGnPaiInterval / 2 of the truth; False: its accuracy is unknown.
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
    """Result of the check of a packet's signature, numbered as RxSecurity.status of RawRxMessage."""

    NONE = 0
    INVALID_FMT = 1
    VERIFIED_PKT = 2
    UNVERIFIABLE_PKT = 3


class Security(NamedTuple):
    """Security result of a packet: signature status, ITS-AID and SSP."""

    status: SecurityStatus = SecurityStatus.NONE
    its_aid: int = 0
    ssp: bytes = b""  # service-specific permissions of the signer, at most 32 octets


NOT_SECURED = Security()
NO_MAC = bytes(6)


class RxInfo(NamedTuple):
    """Metadata of a received PDU; a field that the interface does not know keeps its default."""

    btp_port: int | None = None
    rssi_dbm: int | None = None
    data_rate: int = 0  # data rate of the radio, in units of 500 kbit/s
    traffic_class: int = 0
    hop_limit: int = 0  # remaining hop limit of the packet
    security: Security = NOT_SECURED
    position: Position = Position()  # position of the sender
    area: Area | None = None
    source_mac: bytes = NO_MAC
    transport: str = ""  # shb, gbc, tsb, guc, gac, beacon; empty on an interface without GeoNetworking
    source: str = ""  # identifier of the broker's client that sent the PDU, if the broker's messages contain it
    implausible: tuple[Implausible, ...] = ()  # reasons why the message is implausible; empty for a plausible one

    @property
    def sender(self) -> str:
        """Name of the sender at a broker, else its MAC address; empty if both are unknown."""
        return self.source or (self.source_mac.hex(":") if self.source_mac != NO_MAC else "")


NO_RX_INFO = RxInfo()


class MessageType(NamedTuple):
    """A row of the table of message types.

    name           name in the envelope; empty for a messageID without a name (`v2x..`).
    number         messageID: second octet of the PDU.
    btp_port       destination BTP port in the profile in use; None if the type has none.
    priority       default priority in the policy; 0 is sent first.
    row            row in the table of types and in the counters; all unknown messageIDs share the last row.
    lifetime       default lifetime in seconds: an older message is dropped instead of sent. It is also written into
                   the header of the single-hop broadcast. The policy or the user may set another value.
    traffic_class  default traffic class, an octet of the GeoNetworking common header. The policy or the user may set
                   another value.
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
    """A PDU received from an interface.

    received_ns  time of reception: Unix time in nanoseconds, by the kernel's time stamp if there is one.
    monotonic    time when the station took the PDU, by the loop's clock.
    quality      quality of the station's time in the second of the reception.
    """

    kind: MessageType
    pdu: bytes
    interface: str
    received_ns: int
    monotonic: float
    rx: RxInfo
    quality: TimeQuality = UNKNOWN_TIME


class Request(NamedTuple):
    """A PDU to send. All interfaces that send it share one Request object.

    number         running number of the request since the station's start.
    accepted       time when the station accepted the request, by the loop's clock.
    deadline       time after which the request is dropped instead of sent, by the loop's clock.
    priority       priority in the queue of an interface; 0 is sent first.
    traffic_class  octet of the GeoNetworking common header.
    area           destination area of a GeoBroadcast; None for a single-hop broadcast.
    hop_limit      hop limit of a GeoBroadcast.
    label          identifier chosen by the user, returned in confirms; empty without one.
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
    """Outcome of a request, as in confirm messages."""

    ACCEPTED = "accepted"  # the station accepted it; the confirm names the interfaces that it goes to
    SENT = "sent"  # this interface sent it
    REFUSED = "refused"  # the station refused it before it reached an interface
    DROPPED = "dropped"  # the queue or the driver of this interface dropped it


# Fault of a message in JSON: path, problem, and the invalid value; None if the value is missing.
Fault = tuple[str, str, object]


class Confirm(NamedTuple):
    """An answer to a request. The user gets one when the station accepts or refuses it, then one for each interface.

    invalid  faults of a message in JSON.
    """

    request: Request
    outcome: Outcome
    interface: str = ""
    reason: Reason | None = None
    queue_s: float = 0.0  # seconds from acceptance until the driver got the request
    send_s: float = 0.0  # seconds from then until it had left
    detail: str = ""  # explanation that the reason does not contain
    invalid: Sequence[Fault] = ()
