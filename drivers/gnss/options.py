"""Options of an interface with a GNSS receiver."""

from dataclasses import dataclass
from typing import Annotated, Literal

from board.runtime.address import address
from board.runtime.describe import Range
from board.runtime.errors import ConfigurationError
from drivers.wire.ddc import ADDRESS

TCP = "tcp://"

# Factory setting of a ZED-F9P's UARTs, and of most current NMEA receivers.
FACTORY_BAUD = 38_400
# At 10 Hz, epochs need 25,000 bits per second; together with the other messages that exceeds the factory rate.
BAUD = 230_400

Angle = Annotated[float, Range(-180.0, 180.0)]


@dataclass(frozen=True)
class GnssOptions:
    """A GNSS receiver.

    kind              `ubx`: a u-blox receiver of generation 9, which the station configures; `nmea`: any receiver,
                      as it is; `static`: no receiver, but a surveyed position.
    usb               topology path of the receiver, such as `1-1.1`; in place of port.
    port              path of the serial port.
    i2c               path of the I2C bus, with i2c_address; only `ubx`.
    i2c_address       address at the bus.
    receiver_port     port of the receiver that is connected. Empty: `usb` with usb or a ttyACM, else `uart1`.
    baud              speed of a UART. Left out: 230400 with `ubx`, 38400 with `nmea`. `ubx` also finds a receiver at
                      its factory speed.
    rate_hz           epochs per second.
    dynamics          motion of the antenna.
    pulse             the receiver sends one pulse per second while time is known, and time marks for them.
    antenna_delay_ns  delay of the antenna cable: 5 ns per metre.
    save              keep the configuration in the receiver's flash; only differences are written.
    corrections       RTCM 3 for RTK: path of a file that may grow, or `tcp://192.0.2.1:2101`.
    latitude          latitude of a `static` position, WGS84.
    longitude         longitude of a `static` position, WGS84.
    altitude_m        altitude of a `static` position above the ellipsoid.
    accuracy_m        accuracy of a `static` position.

    Raises ConfigurationError if a static position has no latitude and longitude, or if not exactly one of usb, port and
    i2c is given. Also for corrections or i2c with another kind than ubx, and for corrections of an unknown scheme.
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
            self.surveyed()
            return
        if sum(map(bool, (self.usb, self.port, self.i2c))) != 1:
            raise ConfigurationError("a receiver needs one of usb, port and i2c", "give exactly one of them")
        for name in ("corrections", "i2c"):
            if getattr(self, name) and self.kind != "ubx":
                raise ConfigurationError(f'{name}: needs kind = "ubx", not "{self.kind}"', "leave it out")
        scheme, is_url, _ = self.corrections.partition("://")
        if is_url and f"{scheme}://" != TCP:
            what = f'corrections: "{scheme}://" is unsupported'  # without the rest, which may contain a password
            raise ConfigurationError(what, f"{TCP}HOST:PORT, or the path of a file; NTRIP needs another program")
        if self.corrections.startswith(TCP):
            address(self.corrections.removeprefix(TCP))

    def surveyed(self) -> tuple[float, float]:
        """Return latitude and longitude of `static` in degrees. Raises ConfigurationError if one is missing."""
        if self.latitude is None or self.longitude is None:
            raise ConfigurationError('kind = "static": no latitude and longitude', "give both, in degrees")
        return self.latitude, self.longitude

    @property
    def rate_baud(self) -> int:
        """Baud rate: option `baud`, else the default of the kind."""
        return self.baud or (BAUD if self.kind == "ubx" else FACTORY_BAUD)

    @property
    def where(self) -> str:
        """Place of the receiver in words, for messages."""
        if self.i2c:
            return f"{self.i2c}, address {self.i2c_address:#04x}"
        return self.port or f"USB place {self.usb}"

    @property
    def own_port(self) -> str:
        """Port of the receiver that the station is connected to: i2c, usb, uart1 or uart2."""
        if self.i2c:
            return "i2c"
        return self.receiver_port or ("usb" if self.usb or "ttyACM" in self.port else "uart1")
