"""UBX messages: decodes and encodes payloads.

Fields have the order and units of the payload; names of fields contain the unit. Reserved octets are left out.
Flags remain numbers; properties give the meaning of single bits.
Source: u-blox F9 HPG 1.32 interface description, clause 3.
"""

from collections.abc import Callable
from struct import Struct
from typing import Any, NamedTuple

from board.runtime.errors import ProtocolError
from drivers.wire.ublox import ubx
from drivers.wire.ublox.health import MonRf, MonVer, SecSig
from drivers.wire.ublox.time import NavTimeLs, TimTp
from drivers.wire.ublox.ubx import Kind
from drivers.wire.ublox.values import ValGet, ValSet


class NavPvt(NamedTuple):
    """Position, velocity and time of one epoch. Angles in 1e-7 degree, headings in 1e-5 degree; second may be 60."""

    itow_ms: int
    year: int
    month: int
    day: int
    hour: int
    minute: int
    second: int
    valid: int
    time_accuracy_ns: int
    nano: int  # -1e9..1e9 ns, added to the time in whole seconds above
    fix_type: int
    flags: int
    flags2: int
    satellites: int
    longitude: int
    latitude: int
    height_mm: int
    above_sea_mm: int
    horizontal_mm: int
    vertical_mm: int
    north_mm_s: int
    east_mm_s: int
    down_mm_s: int
    speed_mm_s: int
    heading: int
    speed_accuracy_mm_s: int
    heading_accuracy: int
    pdop: int  # in units of 0.01
    flags3: int
    vehicle_heading: int
    declination: int  # in units of 0.01 degree
    declination_accuracy: int

    @property
    def is_date_valid(self) -> bool:
        return bool(self.valid & 1)

    @property
    def is_time_valid(self) -> bool:
        return bool(self.valid & 2)

    @property
    def is_fully_resolved(self) -> bool:
        """True if UTC is certain to the second: leap seconds came from satellites."""
        return bool(self.valid & 4)

    @property
    def is_confirmed(self) -> bool:
        """True if the receiver has confirmed date and time, or cannot report confirmation."""
        can_tell = self.flags2 & 0x20
        return not can_tell or self.flags2 & 0xC0 == 0xC0

    @property
    def is_fix_ok(self) -> bool:
        """True if the fix is within the accuracy limits (gnssFixOK)."""
        return bool(self.flags & 1)

    @property
    def carrier(self) -> int:
        """Carrier phase solution: 0 none, 1 float, 2 fixed."""
        return self.flags >> 6

    @property
    def is_position_invalid(self) -> bool:
        return bool(self.flags3 & 1)

    @property
    def correction_age(self) -> int:
        """Age of the last correction: 0 none, otherwise the index in CORRECTION_AGE_S."""
        return self.flags3 >> 1 & 0xF


# Upper limits in seconds by the code lastCorrectionAge: code 1 is below 1 s, codes from 12 on are above 120 s.
CORRECTION_AGE_S = (0, 1, 2, 5, 10, 15, 20, 30, 45, 60, 90, 120)


class NavStatus(NamedTuple):
    """Navigation status of the receiver, with its spoofing detection."""

    itow_ms: int
    fix_type: int
    flags: int
    fix_status: int
    flags2: int
    first_fix_ms: int  # time to first fix, ms
    since_start_ms: int

    @property
    def spoofing(self) -> int:
        """Spoofing detection: 0 unknown, 1 none, 2 indicated, 3 indicated several times."""
        return self.flags2 >> 3 & 3


class RxmRtcm(NamedTuple):
    """Report of a received RTCM message."""

    version: int
    flags: int
    subtype: int
    station: int
    number: int

    @property
    def is_damaged(self) -> bool:
        return bool(self.flags & 1)

    @property
    def use(self) -> int:
        """Use of the message: 0 unknown, 1 not used, 2 used."""
        return self.flags >> 1 & 3


class Ack(NamedTuple):
    """Positive acknowledgement of a CFG message, by its class and id."""

    class_: int
    id: int


class Nak(NamedTuple):
    """Rejection of a CFG message, by its class and id."""

    class_: int
    id: int


class CfgRst(NamedTuple):
    """Reset of the receiver, which does not acknowledge it.

    forget  data to clear: 0 nothing (hot start), 1 ephemerides (warm start), 0xffff all (cold start).
    mode    0 immediate hardware reset (watchdog), 1 software reset, 2 software reset of navigation only, which keeps
            the configuration.
    """

    forget: int
    mode: int


Message = (
    NavPvt | NavStatus | NavTimeLs | TimTp | RxmRtcm | Ack | Nak | CfgRst | MonVer | MonRf | SecSig | ValSet | ValGet
)

# Messages with a fixed layout.
_LAYOUTS: dict[int, tuple[Struct, Callable[..., Message]]] = {
    Kind.NAV_PVT: (Struct("<IHBBBBBBIiBBBBiiiiIIiiiiiIIHH4xihH"), NavPvt),
    Kind.NAV_STATUS: (Struct("<IBBBBII"), NavStatus),
    Kind.NAV_TIMELS: (Struct("<IB3xBbBbiHH3xB"), NavTimeLs),
    Kind.TIM_TP: (Struct("<IIiHBB"), TimTp),
    Kind.RXM_RTCM: (Struct("<BBHHH"), RxmRtcm),
    Kind.ACK_ACK: (Struct("<BB"), Ack),
    Kind.ACK_NAK: (Struct("<BB"), Nak),
    Kind.CFG_RST: (Struct("<HBx"), CfgRst),
}
# Messages with repeated blocks; they have their own unpack() and pack().
_OTHERS: dict[int, Any] = {
    Kind.MON_VER: MonVer,
    Kind.MON_RF: MonRf,
    Kind.SEC_SIG: SecSig,
    Kind.CFG_VALSET: ValSet,
    Kind.CFG_VALGET: ValGet,
}
_KINDS: dict[object, int] = {make: kind for kind, (_, make) in _LAYOUTS.items()} | {
    one: kind for kind, one in _OTHERS.items()
}


def decode(frame: ubx.UbxFrame) -> Message | None:
    """Return the message in a frame; None for an unsupported kind.

    Raises ProtocolError for a payload that is too short. A longer payload is of a later version; its known part is
    read.
    """
    kind, payload = frame
    found = _LAYOUTS.get(kind)
    if found is not None:
        layout, make = found
        if len(payload) < layout.size:
            raise ProtocolError(f"{ubx.name(kind)} of {len(payload)} octets: it has {layout.size}")
        return make(*layout.unpack_from(payload))
    other = _OTHERS.get(kind)
    if other is None:
        return None
    message: Message = other.unpack(payload)
    return message


def encode(message: Message) -> bytes:
    """Return the frame of a message."""
    kind = _KINDS[type(message)]
    found = _LAYOUTS.get(kind)
    payload: bytes = found[0].pack(*message) if found else _OTHERS[kind].pack(message)
    return ubx.encode(kind, payload)
