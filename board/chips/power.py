"""INA219, INA226 and INA3221: voltage of a rail and of its shunt, registers of 16 bits, big-endian.

The current is computed here from the shunt's voltage, so the calibration registers are not used and a chip that lost
its supply for a moment measures rightly at once.
"""

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from board.errors import InterfaceError
from board.i2c import Transfer

CONFIGURATION = 0
DIE = 0xFF  # of INA226 and INA3221: which of them it is

# The longest first conversion is that of an INA226 with 16 averages: 16 * 2 * 1.1 ms.
FIRST_S = 0.2


class Power(NamedTuple):
    """What a rail gives: volts, amperes (negative: it takes), watts."""

    volts: float
    amps: float
    watts: float


class Kind(NamedTuple):
    """One type of chip.

    configuration  that it is to have: continuous conversion of both voltages, widest range.
    shunt, bus     registers of the first channel; those of the next follow by twos.
    shunt_v, bus_v  of one unit, after the shift.
    is_bus_signed  whether the bus register is; an INA219's 32 V would be negative.
    ready          register and bit that tell that a conversion is complete.
    die            what its identification register reads; None: it has none.
    """

    configuration: int
    shunt: int
    shunt_v: float
    shunt_shift: int
    bus: int
    bus_v: float
    bus_shift: int
    is_bus_signed: bool
    ready: tuple[int, int]
    die: int | None


# INA219: SBOS448, 32 V, +-320 mV, 12 bits. INA226: SBOS547, 16 averages of 1.1 ms. INA3221: SBOS576, its reset value.
KINDS: Mapping[str, Kind] = {
    "ina219": Kind(0x399F, 1, 10e-6, 0, 2, 4e-3, 3, False, (0x02, 1 << 1), None),
    "ina226": Kind(0x4527, 1, 2.5e-6, 0, 2, 1.25e-3, 0, True, (0x06, 1 << 3), 0x2260),
    "ina3221": Kind(0x7127, 1, 40e-6, 3, 2, 8e-3, 3, True, (0x0F, 1 << 0), 0x3220),
}


def read(
    bus: Transfer,
    address: int,
    kind: str,
    shunt_ohm: float,
    channel: int = 1,
    clock: Callable[[], float] = time.monotonic,
) -> Power:
    """Measure a rail.

    kind     of KINDS; channel  1 to 3 of an INA3221, else 1.

    Configures the chip where it is not configured so, and then waits for its first conversion. Raises InterfaceError
    also when another chip of KINDS is found in its place.
    """
    chip = KINDS[kind]
    _configure(bus, address, kind, chip, clock)
    step = 2 * (channel - 1)
    volts = _value(_word(bus, address, chip.bus + step), chip.bus_shift, chip.is_bus_signed) * chip.bus_v
    amps = _value(_word(bus, address, chip.shunt + step), chip.shunt_shift, True) * chip.shunt_v / shunt_ohm
    return Power(volts, amps, volts * amps)


def _configure(bus: Transfer, address: int, kind: str, chip: Kind, clock: Callable[[], float]) -> None:
    if _word(bus, address, CONFIGURATION) == chip.configuration:
        return
    _identify(bus, address, kind, chip)
    bus.transfer(address, bytes([CONFIGURATION]) + chip.configuration.to_bytes(2, "big"), 0)
    found = _word(bus, address, CONFIGURATION)
    if found != chip.configuration:
        raise InterfaceError(
            f"0x{address:02x} on {bus.path}: configuration 0x{chip.configuration:04x} reads back as 0x{found:04x}",
            f"is it an {kind.upper()}? compare the board file with what is fitted",
        )
    register, bit = chip.ready
    until = clock() + FIRST_S
    while not _word(bus, address, register) & bit:
        if clock() > until:
            raise InterfaceError(f"0x{address:02x} on {bus.path}: no conversion within {FIRST_S} s", "is it supplied?")


def _identify(bus: Transfer, address: int, kind: str, chip: Kind) -> None:
    """Refuse a chip that says it is another of ours. Copies of these chips say anything: they are believed."""
    if chip.die is None:
        return
    die = _word(bus, address, DIE)
    for other, another in KINDS.items():
        if other != kind and die == another.die:
            raise InterfaceError(
                f"0x{address:02x} on {bus.path} is an {other.upper()}, not an {kind.upper()}",
                f'give kind = "{other}" in the board file',
            )


def _word(bus: Transfer, address: int, register: int) -> int:
    return int.from_bytes(bus.transfer(address, bytes([register]), 2), "big")


def _value(word: int, shift: int, is_signed: bool) -> int:
    return (word - 0x10000 if is_signed and word & 0x8000 else word) >> shift
