"""The board file: what is soldered, and nothing of what is wanted. Every table of it may be left out."""

import re
from dataclasses import dataclass, field
from typing import Annotated, Literal

from board.describe import Check, Range
from board.errors import ConfigurationError
from board.topology import parse

Address = Annotated[int, Range(0x08, 0x77)]
Seconds = Annotated[float, Range(0.0, 600.0)]

USB_ID = re.compile("[0-9a-f]{4}:[0-9a-f]{4}")


def _place(text: str) -> None:
    if text:
        parse(text)


def _usb_id(text: str) -> None:
    if not USB_ID.fullmatch(text):
        hint = "vendor:product as lsusb shows them, four small hexadecimal digits each: 1546:01a9"
        raise ConfigurationError(f"{text!r} is no id of a USB device", hint)


@dataclass(frozen=True)
class LineDescription:
    """[lines.<name>]: an output, of the Pi or of an expander; it has one of chip, line and expander.

    chip        label of a GPIO chip (`pinctrl-bcm2711`), its name (`gpiochip0`) or its path; with offset.
    offset      of the line in its chip.
    line        the kernel's name of a line (`GPIO18`), in place of chip and offset.
    expander    name of a chip in [expanders]; with pin.
    pin         of the expander, 0 to 15.
    active_low  whether active is the low voltage.
    open_drain  whether only low is driven.
    initial     what it is set to when the station starts; `keep` leaves it as it is found.
    """

    chip: str = ""
    offset: Annotated[int, Range(0, 1023)] = 0
    line: str = ""
    expander: str = ""
    pin: Annotated[int, Range(0, 15)] = 0
    active_low: bool = False
    open_drain: bool = False
    initial: Literal["active", "inactive", "keep"] = "keep"


@dataclass(frozen=True)
class BusDescription:
    """[buses.<name>]: an I2C bus: /dev/i2c-1, or `sim` on the simulated board."""

    path: str


@dataclass(frozen=True)
class ChipDescription:
    """[expanders.<name>]: a PCA9555 and its like."""

    bus: str
    address: Address
    kind: Literal["pca9555"] = "pca9555"


@dataclass(frozen=True)
class RailDescription:
    """[rails.<name>]: a supply that is measured.

    hwmon     name of the kernel's driver (`ina226`) where that owns the chip; else it is read by bus and address.
    shunt_ohm resistance that the current flows through.
    channel   of an INA3221, 1 to 3.
    min_v, max_v, max_a  what it should stay within; none: not watched.
    """

    kind: Literal["ina219", "ina226", "ina3221"]
    bus: str = ""
    address: Address = 0x40
    hwmon: str = ""
    shunt_ohm: Annotated[float, Range(0.0001, 10.0)] = 0.01
    channel: Annotated[int, Range(1, 3)] = 1
    min_v: float | None = None
    max_v: float | None = None
    max_a: float | None = None


@dataclass(frozen=True)
class TemperatureDescription:
    """[temperatures.<name>]: tmp102 at a bus, `hwmon` by the name of its driver, `thermal` by the type of its zone."""

    kind: Literal["tmp102", "hwmon", "thermal"]
    bus: str = ""
    address: Address = 0x48
    source: str = ""  # name of the hwmon device, or type of the thermal zone: cpu-thermal
    max_c: float | None = None


@dataclass(frozen=True)
class FanDescription:
    """[fan]: hwmon is the name of its driver (pwmfan, emc2305)."""

    hwmon: str
    channel: Annotated[int, Range(1, 8)] = 1


@dataclass(frozen=True)
class IdentityDescription:
    """[identity]: an ID EEPROM at a bus; without a bus, what the firmware left in the device tree."""

    bus: str = ""
    address: Address = 0x50


@dataclass(frozen=True)
class SlotDescription:
    """[slots.<name>]: one M.2 or mPCIe place.

    title     what is meant to sit in it.
    usb       topology path of its USB port: `1-1.3` is port 3 of the hub in port 1 of bus 1; empty: not known.
    ids       vendor:product that belong in it (`1546:01a9`); empty: anything.
    power     name of the line that switches its supply.
    reset     name of the line that holds it in reset while active.
    hub_port  whether its hub switches the port's power.
    settle_s  from power to the release of reset.
    wait_s    from there until its device must have appeared.
    off_s     that it stays without power in a power cycle.
    """

    title: str = ""
    usb: Annotated[str, Check(_place)] = ""
    ids: tuple[Annotated[str, Check(_usb_id)], ...] = ()
    power: str = ""
    reset: str = ""
    hub_port: bool = False
    settle_s: Seconds = 0.1
    wait_s: Seconds = 30.0
    off_s: Seconds = 5.0


@dataclass(frozen=True)
class PulseDescription:
    """[pulse]: the input that a receiver's pulse per second comes to; it has one of device, chip, line and kind.

    device      of the kernel, which stamps pulses: `/dev/pps0`, by the overlay pps-gpio.
    chip, offset, line  of a GPIO line, as in [lines]: its edges are stamped by the kernel as well.
    kind        `simulated`: drivers/sim plays it, with the board.
    edge        that begins the second.
    latency_ns  how late a stamp may be without any pulse showing it: interrupt, antenna cable, level shifter.
    interface   of the receiver; empty: the only one that announces pulses.
    """

    device: str = ""
    chip: str = ""
    offset: Annotated[int, Range(0, 1023)] = 0
    line: str = ""
    kind: Literal["", "simulated"] = ""
    edge: Literal["rising", "falling"] = "rising"
    latency_ns: Annotated[int, Range(0, 1_000_000)] = 10_000
    interface: str = ""

    @property
    def where(self) -> str:
        """The input in words."""
        return self.device or self.line or (f"{self.chip} line {self.offset}" if self.chip else self.kind)


@dataclass(frozen=True)
class Hardware:
    """All of it.

    simulated  whether drivers/sim plays the parts.
    """

    name: str
    description: str = ""
    simulated: bool = False
    lines: dict[str, LineDescription] = field(default_factory=dict)
    buses: dict[str, BusDescription] = field(default_factory=dict)
    expanders: dict[str, ChipDescription] = field(default_factory=dict)
    rails: dict[str, RailDescription] = field(default_factory=dict)
    temperatures: dict[str, TemperatureDescription] = field(default_factory=dict)
    fan: FanDescription | None = None
    identity: IdentityDescription | None = None
    slots: dict[str, SlotDescription] = field(default_factory=dict)
    pulse: PulseDescription | None = None
