"""Readings of the kernel's own drivers: /sys/class/hwmon and /sys/class/thermal."""

import os
from collections.abc import Mapping
from pathlib import Path

from board import sysfs
from board.chips.power import Power
from board.description import FanDescription, RailDescription, TemperatureDescription
from board.runtime.errors import InterfaceError

HWMON = "class/hwmon"
THERMAL = "class/thermal"

FULL = 255  # full drive in a pwm file
MANUAL = "1"  # value of a pwm_enable file for control by this program


def rail(sys: Path, rail: RailDescription) -> Power:
    """Read volts, amperes and watts of a rail. Each INA driver has bus voltages in in1 to in3, currents in curr1 to 3.

    The kernel uses the shunt of its device tree, not the board file's. Raises InterfaceError if no device has the
    name, or the chip does not answer.
    """
    device = _device(sys, rail.hwmon, rail.address)
    volts = _number(device / f"in{rail.channel}_input") / 1e3
    amps = _number(device / f"curr{rail.channel}_input") / 1e3
    return Power(volts, amps, volts * amps)


def temperature(sys: Path, temperature: TemperatureDescription) -> float:
    """Read degrees Celsius of a hwmon device by its name, or a thermal zone by its type.

    Raises InterfaceError if the device is absent, or the chip does not answer.
    """
    if temperature.kind == "thermal":
        zones = _by_word(sys / THERMAL, "thermal_zone*", "type", temperature.source)
        if not zones:
            raise InterfaceError(f"{sys / THERMAL}: no zone has the type {temperature.source}", _known(sys, THERMAL))
        return _number(zones[0] / "temp") / 1e3
    return _number(_device(sys, temperature.source, temperature.address) / "temp1_input") / 1e3


def fan(sys: Path, fan: FanDescription) -> Mapping[str, float]:
    """Read the fan: `rpm` if its speed is counted, `percent` if its drive can be set; at least one of them.

    Raises InterfaceError if no device has the name, the fan has neither value, or the chip does not answer.
    """
    device = _device(sys, fan.hwmon)
    speed, drive = device / f"fan{fan.channel}_input", device / f"pwm{fan.channel}"
    found: dict[str, float] = {}
    if speed.exists():
        found["rpm"] = _number(speed)
    if drive.exists():
        found["percent"] = round(_number(drive) * 100 / FULL, 1)
    if not found:
        hint = "correct channel in [fan] of the board file"
        raise InterfaceError(f"{device}: has neither {speed.name} nor {drive.name}", hint)
    return found


def set_fan(sys: Path, fan: FanDescription, percent: float) -> None:
    """Drive the fan, 0 to 100 percent; this ends the kernel's own regulation.

    Raises InterfaceError if no device has the name, or the kernel refuses the value.
    """
    device = _device(sys, fan.hwmon)
    drive = device / f"pwm{fan.channel}"
    enable = device / f"{drive.name}_enable"
    if enable.exists():
        _write(enable, MANUAL)
    _write(drive, str(round(percent * FULL / 100)))


def _device(sys: Path, name: str, address: int | None = None) -> Path:
    """Return the directory of a device by its driver's name; of several on I2C, the one at the address."""
    found = _by_word(sys / HWMON, "hwmon*", "name", name)
    if not found:
        raise InterfaceError(f"{sys / HWMON}: no device is named {name}", _known(sys, HWMON))
    if len(found) > 1 and address is not None:
        # The kernel names an I2C device by its bus and address: 1-0040.
        ending = f"-{address:04x}"
        found = [path for path in found if os.path.realpath(path / "device").endswith(ending)] or found
    return found[0]


def _by_word(directory: Path, pattern: str, file: str, word: str) -> list[Path]:
    """Return the directories whose file holds the word, in the order of their numbers."""
    ordered = sorted(directory.glob(pattern), key=lambda path: (len(path.name), path.name))
    return [path for path in ordered if sysfs.optional(path / file) == word]


def _known(sys: Path, folder: str) -> str:
    """Return a hint that lists the devices that exist."""
    pattern, file = ("hwmon*", "name") if folder == HWMON else ("thermal_zone*", "type")
    words = sorted({sysfs.optional(path / file) for path in (sys / folder).glob(pattern)} - {""})
    return f"known: {', '.join(words) or 'none'}; check that the kernel's driver is loaded"


def _number(path: Path) -> int:
    try:
        return int(sysfs.text(path))
    except OSError as error:
        raise InterfaceError(f"{path}: {error.strerror}", "the chip does not answer its driver") from error
    except ValueError as error:
        raise InterfaceError(f"{path}: does not hold a number") from error


def _write(path: Path, text: str) -> None:
    try:
        path.write_text(text)
    except OSError as error:
        hint = "give the station's user write access" if error.errno == 13 else ""
        raise InterfaceError(f"{path}: {error.strerror}", hint) from error
