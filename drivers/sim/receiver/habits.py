"""Properties of a simulated receiver."""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Literal

from drivers.sim.receiver import messages as says
from drivers.wire.gnss.time import Leap
from drivers.wire.ublox.health import MonVer

VERSION = MonVer(
    "EXT CORE 1.00 (3fda8e)",
    "00190000",
    ("ROM BASE 0x118B2060", "FWVER=HPG 1.32", "PROTVER=27.31", "MOD=ZED-F9P", "GPS;GLO;GAL;BDS", "SBAS;QZSS"),
)


@dataclass(frozen=True)
class Habits:
    """Fixed properties of a simulated receiver.

    gps_s         GPS time when the simulation starts; fraction_s is added.
    gadget        path of a USB gadget's tty (/dev/ttyGS0) to use in place of a pty.
    port          port of the receiver in use. A USB device appears and disappears with the supply. A UART, and the pty
                  in place of an I2C bus, always exist.
    speaks_ubx    False: a receiver with NMEA only.
    boot_s        seconds from power to the first message.
    fix_s, leap_s seconds from power or a cold start to a fix, and to leap seconds from satellites.
    leap          true leap seconds.
    default_leap  leap seconds that the firmware uses until it has them from satellites.
    repeats       True: TIM-TP gives a leap second the number of the second before it. False: of the second after it.
    unknown       names of keys that the firmware does not support.
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
