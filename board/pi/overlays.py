"""Lines of a Raspberry Pi's config.txt that add the devices of a board file.

Source: overlays/README of Raspberry Pi's kernel 6.12 (arch/arm/boot/dts/overlays), and its documentation of config.txt.
"""

import re
from collections.abc import Mapping

from board.description import Hardware

# `Raspberry Pi 400` and `Raspberry Pi Compute Module 4` have the chip of a 4; a 500 and a Compute Module 5 that of a 5.
_MODEL = re.compile(r"Raspberry Pi (?:Compute Module |Zero )?(\d)?")
_FILTER = re.compile(r"Raspberry Pi (Compute Module )?(\d+S?)")
_I2C_4, _I2C_5 = range(3, 7), (0, 2, 3)  # buses with an overlay of their own
_UARTS_4, _UARTS_5 = range(2, 6), range(5)
# GPIOs of a line without parameters.
GPIOS = {
    "enable_uart=1": (14, 15), "dtparam=i2c_arm=on": (2, 3), "dtparam=i2c_vc=on": (0, 1),
    "dtoverlay=i2c3": (4, 5), "dtoverlay=i2c4": (8, 9), "dtoverlay=i2c5": (12, 13), "dtoverlay=i2c6": (22, 23),
    "dtoverlay=uart2": (0, 1), "dtoverlay=uart3": (4, 5), "dtoverlay=uart4": (8, 9), "dtoverlay=uart5": (12, 13),
    "dtoverlay=i2c0-pi5": (0, 1), "dtoverlay=i2c2-pi5": (4, 5), "dtoverlay=i2c3-pi5": (6, 7),
    "dtoverlay=uart0-pi5": (14, 15), "dtoverlay=uart1-pi5": (0, 1), "dtoverlay=uart2-pi5": (4, 5),
    "dtoverlay=uart3-pi5": (8, 9), "dtoverlay=uart4-pi5": (12, 13),
}  # fmt: skip


def generation(model: str) -> int:
    """Return the generation of a Raspberry Pi: 4 for a 4 B, 400 and Compute Module 4; 0 for another machine.

    model  name of the machine in its device tree.
    """
    found = _MODEL.match(model)
    return int(found[1] or 1) if found else 0


def filters(model: str, pi: int) -> tuple[str, ...]:
    """Return the filters of config.txt below which a Raspberry Pi reads: all, pi4 and cm4 for a Compute Module 4.

    model  name of the machine in its device tree; another generation than pi: only the filter of the generation.
    """
    found = _FILTER.match(model)
    own = [f"{'cm' if found[1] else 'pi'}{found[2].lower()}"] if found and generation(model) == pi else []
    return tuple(dict.fromkeys(["all", f"pi{pi}", *own]))


def lines(hardware: Hardware, ports: Mapping[str, str], pi: int) -> dict[str, str]:
    """Return the lines for a board, each with the key of the board file that needs it.

    ports  serial ports by key: {"interfaces.gnss": "/dev/ttyAMA3"}.
    pi     generation of the Raspberry Pi.

    Devices that no overlay adds, such as /dev/ttyUSB0, need no line.
    """
    found: dict[str, str] = {}
    if hardware.pulse is not None and hardware.pulse.gpio is not None:
        found[pulse(hardware.pulse.gpio, hardware.pulse.edge == "falling")] = "pulse.gpio"
    for name, bus in hardware.buses.items():
        number = bus.path.removeprefix("/dev/i2c-")
        if number.isdecimal() and (line := i2c(int(number), pi)):
            found.setdefault(line, f"buses.{name}")
    for key, port in ports.items():
        for line in uart(port.removeprefix("/dev/"), pi):
            found.setdefault(line, key)
    return found


def used_twice(users: Mapping[str, str]) -> tuple[int, str, str] | None:
    """Return the first GPIO that two lines use, with their users; None without one. users: names by line."""
    taken: dict[int, str] = {}
    for line, user in users.items():
        _, at_gpio, number = line.partition("gpiopin=")
        for gpio in (int(number.partition(",")[0]),) if at_gpio else GPIOS.get(line, ()):
            if gpio in taken:
                return gpio, taken[gpio], user
            taken[gpio] = user
    return None


def pulse(gpio: int, is_falling: bool = False) -> str:
    """Return the line that makes /dev/ppsN. is_falling: the kernel also reports falling edges, as `clear`."""
    return f"dtoverlay=pps-gpio,gpiopin={gpio}{',capture_clear' if is_falling else ''}"


def i2c(number: int, pi: int) -> str:
    """Return the line that makes /dev/i2c-<number>; empty if no overlay does."""
    if number == 1:
        return "dtparam=i2c_arm=on"
    if pi >= 5:
        return f"dtoverlay=i2c{number}-pi5" if number in _I2C_5 else ""
    if number == 0:
        return "dtparam=i2c_vc=on"
    return f"dtoverlay=i2c{number}" if pi == 4 and number in _I2C_4 else ""


def uart(device: str, pi: int) -> list[str]:
    """Return the lines that make a serial port of the header; empty for other ports. device: name below /dev."""
    number = device.removeprefix("ttyAMA")
    if pi >= 5:
        return [f"dtoverlay=uart{number}-pi5"] if number in map(str, _UARTS_5) else []
    if device == "ttyAMA0":  # on a Pi with Bluetooth, which then gets the other one
        return ["enable_uart=1", "dtoverlay=miniuart-bt"]
    if device in ("ttyS0", "serial0"):
        return ["enable_uart=1"]
    return [f"dtoverlay=uart{number}"] if pi == 4 and number in map(str, _UARTS_4) else []


def console(device: str, pi: int) -> tuple[str, ...]:
    """Return the names by which a command line may call the console of a serial port. device: name below /dev."""
    first = ("ttyAMA10",) if pi >= 5 else ("ttyS0", "ttyAMA0")
    if device == "serial0":
        return ("serial0", *first)
    return (device, "serial0") if device in first else (device,)
