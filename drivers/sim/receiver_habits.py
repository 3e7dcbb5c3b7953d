"""What a simulated receiver is like."""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Literal

from drivers.sim import receiver_messages as says
from drivers.wire.gnss_time import Leap
from drivers.wire.ubx_health import MonVer

VERSION = MonVer(
    "EXT CORE 1.00 (3fda8e)",
    "00190000",
    ("ROM BASE 0x118B2060", "FWVER=HPG 1.32", "PROTVER=27.31", "MOD=ZED-F9P", "GPS;GLO;GAL;BDS", "SBAS;QZSS"),
)


@dataclass(frozen=True)
class Habits:
    """What a receiver is like.

    gps_s         GPS time when it is made; fraction_s is added.
    gadget        path of a USB gadget's tty (/dev/ttyGS0) that it speaks at, in place of a pty.
    port          that somebody is at: a USB device comes and goes; a UART, and what stands for an I2C bus, is
                  always there.
    speaks_ubx    False: an NMEA receiver.
    boot_s        from power to the first word.
    fix_s, leap_s from power, or a cold reset, to a fix, and to leap seconds from satellites.
    leap          true leap seconds; default_leap is what the firmware takes before it has them.
    repeats       how TIM-TP numbers a leap second: as the second before it, or as that behind.
    unknown       names of keys that its firmware does not know.
    """

    gps_s: int = says.gps_of(2026, 6, 1, 8, 0, 0)
    fraction_s: float = 0.0
    port: Literal["usb", "uart1", "i2c"] = "usb"
    gadget: str = ""
    speaks_ubx: bool = True
    boot_s: float = 0.8
    fix_s: float = 2.0
    leap_s: float = 2.0
    leap: Leap = field(default_factory=lambda: Leap(18))
    default_leap: int = 18
    repeats: bool = False
    unknown: Collection[str] = ()
    version: MonVer = VERSION
