"""UBX messages, from payload to fields and back.

Fields stand in the order of the payload and in its units, which their names say; reserved octets are left out.
Flags stay numbers; what is asked of them has a name of its own.
Source: u-blox F9 HPG 1.32 interface description, clause 3.
"""

from collections.abc import Callable
from struct import Struct
from typing import Any, NamedTuple

from board.errors import ProtocolError
from drivers.wire import ubx
from drivers.wire.ubx import Kind
from drivers.wire.ubx_health import MonRf, MonVer, SecSig
from drivers.wire.ubx_time import NavTimeLs, TimTp
from drivers.wire.ubx_values import ValGet, ValSet


class NavPvt(NamedTuple):
    """Position, velocity and time of one epoch. Angles 1e-7 degree, headings 1e-5 degree; second may be 60."""

    itow_ms: int
    year: int
    month: int
    day: int
    hour: int
    minute: int
    second: int
    valid: int
    time_accuracy_ns: int
    nano: int  # -1e9..1e9: what the second above is to be corrected by
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
    pdop: int  # 0.01
    flags3: int
    vehicle_heading: int
    declination: int  # 0.01 degree
    declination_accuracy: int

    @property
    def is_date_valid(self) -> bool:
        return bool(self.valid & 1)

    @property
    def is_time_valid(self) -> bool:
        return bool(self.valid & 2)

    @property
    def is_fully_resolved(self) -> bool:
        """Whether UTC has no doubt of a second left: leap seconds came from satellites."""
        return bool(self.valid & 4)

    @property
    def is_confirmed(self) -> bool:
        """Whether date and time were confirmed, by a receiver that is able to say so."""
        can_tell = self.flags2 & 0x20
        return not can_tell or self.flags2 & 0xC0 == 0xC0

    @property
    def is_fix_ok(self) -> bool:
        """Whether the fix is within the limits of accuracy."""
        return bool(self.flags & 1)

    @property
    def carrier(self) -> int:
        """0 none, 1 float, 2 fixed."""
        return self.flags >> 6

    @property
    def is_position_invalid(self) -> bool:
        return bool(self.flags3 & 1)

    @property
    def correction_age(self) -> int:
        """0 none, else the row of CORRECTION_AGE_S."""
        return self.flags3 >> 1 & 0xF


# Upper ends of lastCorrectionAge, s: 1 is below 1 s, 12 and more are above 120 s.
CORRECTION_AGE_S = (0, 1, 2, 5, 10, 15, 20, 30, 45, 60, 90, 120)


class NavStatus(NamedTuple):
    """State of the navigation, with what it thinks of spoofing."""

    itow_ms: int
    fix_type: int
    flags: int
    fix_status: int
    flags2: int
    first_fix_ms: int  # time to first fix
    since_start_ms: int

    @property
    def spoofing(self) -> int:
        """0 unknown, 1 none, 2 indicated, 3 indicated several times."""
        return self.flags2 >> 3 & 3


class RxmRtcm(NamedTuple):
    """An RTCM message came in."""

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
        """0 unknown, 1 not used, 2 used."""
        return self.flags >> 1 & 3


class Ack(NamedTuple):
    """The receiver took a CFG message of a kind."""

    class_: int
    id: int


class Nak(NamedTuple):
    """The receiver refused a CFG message of a kind."""

    class_: int
    id: int


class CfgRst(NamedTuple):
    """Reset; nothing acknowledges it.

    forget  what of its memory is lost: 0 nothing (hot), 1 ephemerides (warm), 0xffff all (cold).
    mode    0 at once as by its watchdog, 1 all of its software, 2 only that of navigation: the configuration stays.
    """

    forget: int
    mode: int


Message = (
    NavPvt | NavStatus | NavTimeLs | TimTp | RxmRtcm | Ack | Nak | CfgRst | MonVer | MonRf | SecSig | ValSet | ValGet
)

# Messages whose payload has one shape.
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
# Messages that take themselves apart.
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


def decode(frame: ubx.Frame) -> Message | None:
    """The message in a frame; None for a kind that is in no table here.

    Raises ProtocolError for a payload that is too short. A longer one is a later version: what is known of it is read.
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
    """The frame of a message."""
    kind = _KINDS[type(message)]
    found = _LAYOUTS.get(kind)
    payload: bytes = found[0].pack(*message) if found else _OTHERS[kind].pack(message)
    return ubx.encode(kind, payload)
