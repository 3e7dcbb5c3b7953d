"""Board file as frozen dataclasses: soldered hardware; every table is optional."""

import re
from dataclasses import dataclass, field
from typing import Annotated, Literal

from board.runtime.describe import Check, Range
from board.runtime.errors import ConfigurationError
from board.topology import parse

Address = Annotated[int, Range(0x08, 0x77)]
Seconds = Annotated[float, Range(0.0, 600.0)]

USB_ID = re.compile("[0-9a-f]{4}:[0-9a-f]{4}")


def _place(text: str) -> None:
    if text:
        parse(text)


def _usb_id(text: str) -> None:
    if not USB_ID.fullmatch(text):
        hint = "write vendor:product as in lsusb, four lower-case hexadecimal digits each: 1546:01a9"
        raise ConfigurationError(f"invalid id of a USB device: {text!r}", hint)


@dataclass(frozen=True)
class LineDescription:
    """[lines.<name>]: an output of the Pi or of an expander. Give one of chip, line and expander.

    chip        label of a GPIO chip (`pinctrl-bcm2711`), its name (`gpiochip0`) or its path; with offset.
    offset      number of the line in its chip.
    line        the kernel's name of a line (`GPIO18`), in place of chip and offset.
    expander    name of a chip in [expanders]; with pin.
    pin         pin of the expander.
    active_low  the line is active at low voltage.
    open_drain  only the low level is driven.
    initial     state when the station starts; `keep` leaves it as it is.
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
    """[buses.<name>]: an I2C bus.

    path  such as /dev/i2c-1, or `sim` on the simulated board.
    """

    path: str


@dataclass(frozen=True)
class ChipDescription:
    """[expanders.<name>]: a GPIO expander.

    bus      name of a bus in [buses].
    address  address at the bus.
    kind     type of the chip.
    """

    bus: str
    address: Address
    kind: Literal["pca9555"] = "pca9555"


@dataclass(frozen=True)
class RailDescription:
    """[rails.<name>]: a measured supply.

    kind       type of the chip.
    bus        name of a bus in [buses].
    address    address at the bus.
    hwmon      name of the kernel's driver (`ina226`), if the kernel has the chip. Empty: read by bus and address.
    shunt_ohm  resistance of the shunt.
    channel    channel of an INA3221.
    min_v      lowest permitted voltage. Left out: not checked.
    max_v      highest permitted voltage. Left out: not checked.
    max_a      highest permitted current. Left out: not checked.
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
    """[temperatures.<name>]: a temperature sensor.

    kind     `tmp102`: a chip at a bus; `hwmon`: a hwmon device of the kernel; `thermal`: a thermal zone of the kernel.
    bus      name of a bus in [buses].
    address  address at the bus.
    source   name of the hwmon device, or type of the thermal zone (`cpu-thermal`).
    max_c    highest permitted temperature. Left out: not checked.
    """

    kind: Literal["tmp102", "hwmon", "thermal"]
    bus: str = ""
    address: Address = 0x48
    source: str = ""
    max_c: float | None = None


@dataclass(frozen=True)
class FanDescription:
    """[fan]: the fan.

    hwmon    name of its kernel driver (`pwmfan`, `emc2305`).
    channel  number of the fan at its driver.
    """

    hwmon: str
    channel: Annotated[int, Range(1, 8)] = 1


@dataclass(frozen=True)
class IdentityDescription:
    """[identity]: ID EEPROM of a HAT.

    bus      name of a bus in [buses]. Empty: what the firmware left in the device tree.
    address  address at the bus.
    """

    bus: str = ""
    address: Address = 0x50


@dataclass(frozen=True)
class SlotDescription:
    """[slots.<name>]: one M.2 or mPCIe slot.

    title     module for which the slot is meant.
    usb       topology path of its USB port: `1-1.3` is port 3 of the hub in port 1 of bus 1. Empty: unknown.
    ids       vendor:product of its devices (`1546:01a9`). Empty: any.
    power     name of the line that switches its supply. Empty: see `hub_port`; without either, the station
              deauthorizes the USB device.
    reset     name of the line that holds it in reset while active.
    hub_port  the USB hub switches the power of the port.
    settle_s  time from power to the release of reset.
    wait_s    time from there until its device must have appeared.
    off_s     time without power in a power cycle.
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
    """[pulse]: the input of a receiver's pulse per second. Give one of device, chip, line and kind.

    device      PPS device of the kernel, such as `/dev/pps0` of the overlay pps-gpio.
    gpio        GPIO of the Raspberry Pi's header that makes `device`: `captain box setup` adds the overlay for it.
    chip        GPIO chip as in [lines], without a PPS device: the kernel stamps edges of GPIO lines too.
    offset      number of the line in its chip.
    line        the kernel's name of a line, in place of chip and offset.
    kind        `simulated`: the simulated board has the pulse.
    edge        edge of the voltage that begins the second; for a PPS device, the edge that its overlay calls assert.
    latency_ns  largest delay of a time stamp, by interrupt, antenna cable and level shifter. Pulses cannot show it.
    interface   interface of the receiver. Empty: the only one that announces pulses.
    """

    device: str = ""
    gpio: Annotated[int, Range(0, 27)] | None = None
    chip: str = ""
    offset: Annotated[int, Range(0, 1023)] = 0
    line: str = ""
    kind: Literal["", "simulated"] = ""
    edge: Literal["rising", "falling"] = "rising"
    latency_ns: Annotated[int, Range(0, 1_000_000)] = 10_000
    interface: str = ""

    @property
    def where(self) -> str:
        """Name of the pulse input, for messages."""
        return self.device or self.line or (f"{self.chip} line {self.offset}" if self.chip else self.kind)


@dataclass(frozen=True)
class Hardware:
    """Hardware of a board: its soldered parts, without settings of the station.

    name          name of the board in status.
    description   one line about the board.
    simulated     the program simulates all parts.
    lines         outputs.
    buses         I2C buses.
    expanders     GPIO expanders.
    rails         measured supplies.
    temperatures  temperature sensors.
    fan           the fan.
    identity      ID EEPROM of a HAT.
    slots         slots for modules.
    pulse         input of the pulse per second.
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
