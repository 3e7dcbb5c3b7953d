"""UBX messages about time: leap seconds and the next time pulse.

Fields and their units are as in messages.py.
Source: u-blox F9 HPG 1.32 interface description, clause 3.
"""

from typing import NamedTuple


class NavTimeLs(NamedTuple):
    """Leap seconds: current difference of GPS time and UTC, and its next change."""

    itow_ms: int
    version: int
    source: int  # 0 the firmware's default, 1 GLONASS, 2 GPS, 3 SBAS, 4 BeiDou, 5 Galileo, 255 unknown
    leap_seconds: int
    change_source: int
    change: int  # change of leap_seconds at the event: -1, 0 or 1
    to_event_s: int  # seconds until the event; negative after it
    event_week: int  # week of the event, which is at the end of event_day in UTC
    event_day: int  # 1 Sunday ... 7 Saturday
    valid: int

    @property
    def is_known(self) -> bool:
        """True if leap_seconds came from satellites."""
        return bool(self.valid & 1) and self.source not in (0, 255)

    @property
    def is_event_known(self) -> bool:
        return bool(self.valid & 2)


class TimTp(NamedTuple):
    """Time of the next pulse: week and time of week."""

    tow_ms: int
    tow_fraction: int  # in units of 2**-32 ms
    quantisation_ps: int
    week: int
    flags: int
    reference: int

    @property
    def is_utc(self) -> bool:
        """True if week and time of week count UTC; otherwise they count GNSS time, with leap seconds."""
        return bool(self.flags & 1)

    @property
    def is_quantisation_valid(self) -> bool:
        """True unless bit 4 reports an invalid quantisation error; the bit exists since protocol 32."""
        return not self.flags & 0x10

    @property
    def is_locked(self) -> bool:
        """True unless bit 5 reports that the pulse is not locked; the bit exists since protocol 32."""
        return not self.flags & 0x20

    @property
    def system(self) -> int:
        """GNSS of the time, if it is not UTC: 0 GPS, 1 GLONASS, 2 BeiDou, 3 Galileo, 15 unknown."""
        return self.reference & 0xF
