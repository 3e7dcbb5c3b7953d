"""What captain.toml may say of a GNSS receiver."""

from dataclasses import dataclass
from typing import Annotated, Literal

from board.address import address
from board.describe import Range
from board.errors import ConfigurationError
from drivers.wire.ddc import ADDRESS

TCP = "tcp://"

# What a ZED-F9P speaks on its UARTs before it is told otherwise, and most NMEA receivers of today.
FACTORY_BAUD = 38_400
# A second of epochs at 10 Hz has 25,000 bits: with what else is asked for they do not fit into the factory's rate.
BAUD = 230_400

Angle = Annotated[float, Range(-180.0, 180.0)]


@dataclass(frozen=True)
class GnssOptions:
    """Options of an interface with driver = "zed_f9p".

    kind              `ubx`: a u-blox receiver of generation 9, configured by us; `nmea`: any receiver, as it is;
                      `static`: no receiver, but a position that was surveyed.
    usb               topology path of the receiver: `1-1.1`; in place of port.
    port              path of the serial port.
    i2c               path of the I2C bus that it is at, with i2c_address; only ubx.
    receiver_port     which of the receiver's own ports it is; by itself: `usb` with usb or a ttyACM, else `uart1`.
    baud              bits per second, of UARTs; by itself 230400 with ubx, 38400 with nmea. ubx finds a receiver
                      that still has its factory's rate.
    rate_hz           epochs a second.
    dynamics          how the antenna moves.
    pulse             whether there are time pulses, one a second while time is known, and time marks for them.
    antenna_delay_ns  of the antenna's cable: 5 ns per metre.
    save              keep the configuration in the receiver's flash; only what differs is written.
    corrections       RTCM 3 for RTK: path of a file that may grow, or `tcp://192.0.2.1:2101`.
    latitude, longitude, altitude_m  of static: degrees, WGS84; above the ellipsoid.
    accuracy_m        of static.
    """

    kind: Literal["ubx", "nmea", "static"] = "ubx"
    usb: str = ""
    port: str = ""
    i2c: str = ""
    i2c_address: Annotated[int, Range(0x08, 0x77)] = ADDRESS
    receiver_port: Literal["", "usb", "uart1", "uart2"] = ""
    baud: Annotated[int, Range(4800, 921_600)] | None = None
    rate_hz: Annotated[int, Range(1, 20)] = 5
    dynamics: Literal["portable", "stationary", "pedestrian", "automotive", "sea", "airborne"] = "automotive"
    pulse: bool = True
    antenna_delay_ns: Annotated[int, Range(-32_768, 32_767)] = 50
    save: bool = False
    corrections: str = ""
    latitude: Annotated[float, Range(-90.0, 90.0)] | None = None
    longitude: Angle | None = None
    altitude_m: Annotated[float, Range(-1000.0, 20_000.0)] | None = None
    accuracy_m: Annotated[float, Range(0.001, 1000.0)] = 1.0

    def __post_init__(self) -> None:
        if self.kind == "static":
            if self.latitude is None or self.longitude is None:
                raise ConfigurationError("a static position has no latitude and longitude", "give both, in degrees")
            return
        if sum(map(bool, (self.usb, self.port, self.i2c))) != 1:
            raise ConfigurationError("a receiver has one of usb, port and i2c", "give exactly one of them")
        for name in ("corrections", "i2c"):
            if getattr(self, name) and self.kind != "ubx":
                raise ConfigurationError(f"{name}: only for kind ubx, not {self.kind}", "leave it out")
        scheme, is_url, _ = self.corrections.partition("://")
        if is_url and f"{scheme}://" != TCP:
            what = f'corrections: "{scheme}://" is not read'  # what follows may be a password
            raise ConfigurationError(what, f"{TCP}HOST:PORT, or the path of a file; NTRIP needs a program of its own")
        if self.corrections.startswith(TCP):
            address(self.corrections.removeprefix(TCP))

    @property
    def rate_baud(self) -> int:
        """baud, or what stands in for it."""
        return self.baud or (BAUD if self.kind == "ubx" else FACTORY_BAUD)

    @property
    def where(self) -> str:
        """It is, for people."""
        if self.i2c:
            return f"{self.i2c}, address {self.i2c_address:#04x}"
        return self.port or f"USB place {self.usb}"

    @property
    def own_port(self) -> str:
        """i2c, usb, uart1 or uart2."""
        if self.i2c:
            return "i2c"
        return self.receiver_port or ("usb" if self.usb or "ttyACM" in self.port else "uart1")
