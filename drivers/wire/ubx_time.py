"""UBX messages about time: which leap seconds it has, and which pulse comes next.

Fields and their units are as in ubx_messages.py.
Source: u-blox F9 HPG 1.32 interface description, clause 3.
"""

from typing import NamedTuple


class NavTimeLs(NamedTuple):
    """Leap seconds: GPS time less UTC now, and when that changes."""

    itow_ms: int
    version: int
    source: int  # 0 the firmware's default, 1 GLONASS, 2 GPS, 3 SBAS, 4 BeiDou, 5 Galileo, 255 unknown
    leap_seconds: int
    change_source: int
    change: int  # -1, 0 or 1 at the event
    to_event_s: int  # negative: since the event
    event_week: int  # the event is at the end of this day in UTC
    event_day: int  # 1 Sunday ... 7 Saturday
    valid: int

    @property
    def is_known(self) -> bool:
        """Whether leap_seconds came from satellites."""
        return bool(self.valid & 1) and self.source not in (0, 255)

    @property
    def is_event_known(self) -> bool:
        return bool(self.valid & 2)


class TimTp(NamedTuple):
    """The next time pulse: at which second of which week it will come."""

    tow_ms: int
    tow_fraction: int  # 2**-32 ms
    quantisation_ps: int
    week: int
    flags: int
    reference: int

    @property
    def is_utc(self) -> bool:
        """Whether week and time of week count UTC; otherwise the time of a satellite system, with leap seconds."""
        return bool(self.flags & 1)

    @property
    def is_quantisation_valid(self) -> bool:
        """Older firmware never says that it is not (bit 4 since protocol 32)."""
        return not self.flags & 0x10

    @property
    def is_locked(self) -> bool:
        """Older firmware never says that it is not (bit 5 since protocol 32)."""
        return not self.flags & 0x20

    @property
    def system(self) -> int:
        """Whose time it is where it is not UTC: 0 GPS, 1 GLONASS, 2 BeiDou, 3 Galileo, 15 unknown."""
        return self.reference & 0xF
