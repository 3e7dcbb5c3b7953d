"""INA219, INA226 and INA3221: voltages of a rail and its shunt, in big-endian registers of 16 bits.

The current is computed here from the shunt's voltage. The calibration registers are not used, so a chip measures
correctly at once after a loss of its supply.
"""

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from board.i2c import Transfer, read_word
from board.runtime.errors import InterfaceError

CONFIGURATION = 0
DIE = 0xFF  # identification register of INA226 and INA3221

# Time limit of the first conversion. The slowest chip is an INA226 with 16 averages: 16 * 2 * 1.1 ms.
FIRST_S = 0.2


class Power(NamedTuple):
    """Power of a rail: volts, amperes (negative if the rail sinks current), watts."""

    volts: float
    amps: float
    watts: float


class PowerChip(NamedTuple):
    """Registers and units of one type of chip.

    configuration   value to configure: continuous conversion of both voltages, widest range.
    shunt, bus      registers of the first channel; each further channel is two registers higher.
    shunt_v, bus_v  volts of one unit, after the shift.
    is_bus_signed   the bus register is signed. It is not in an INA219, where 32 V would read as negative.
    ready           register, and mask of the bit that reports a complete conversion.
    die             value of its identification register; None: it has no such register.
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
KINDS: Mapping[str, PowerChip] = {
    "ina219": PowerChip(0x399F, 1, 10e-6, 0, 2, 4e-3, 3, False, (0x02, 1 << 1), None),
    "ina226": PowerChip(0x4527, 1, 2.5e-6, 0, 2, 1.25e-3, 0, True, (0x06, 1 << 3), 0x2260),
    "ina3221": PowerChip(0x7127, 1, 40e-6, 3, 2, 8e-3, 3, True, (0x0F, 1 << 0), 0x3220),
}


def read(
    bus: Transfer,
    address: int,
    kind: str,
    shunt_ohm: float,
    channel: int = 1,
    clock: Callable[[], float] = time.monotonic,
) -> Power:
    """Measure volts, amperes and watts of a rail.

    kind     name of the type in KINDS.
    channel  1 to 3 for an INA3221, else 1.

    Configures the chip if its configuration differs, then waits for the first conversion. Raises InterfaceError if
    the chip does not answer, does not keep the configuration, has no supply, or is another type of KINDS.
    """
    chip = KINDS[kind]
    _configure(bus, address, kind, chip, clock)
    step = 2 * (channel - 1)
    volts = _value(read_word(bus, address, chip.bus + step), chip.bus_shift, chip.is_bus_signed) * chip.bus_v
    amps = _value(read_word(bus, address, chip.shunt + step), chip.shunt_shift, True) * chip.shunt_v / shunt_ohm
    return Power(volts, amps, volts * amps)


def _configure(bus: Transfer, address: int, kind: str, chip: PowerChip, clock: Callable[[], float]) -> None:
    if read_word(bus, address, CONFIGURATION) == chip.configuration:
        return
    _identify(bus, address, kind, chip)
    bus.transfer(address, bytes([CONFIGURATION]) + chip.configuration.to_bytes(2, "big"), 0)
    found = read_word(bus, address, CONFIGURATION)
    if found != chip.configuration:
        raise InterfaceError(
            f"0x{address:02x} on {bus.path}: configuration 0x{chip.configuration:04x} reads back as 0x{found:04x}",
            f"check that an {kind.upper()} is fitted, as the board file says",
        )
    register, bit = chip.ready
    until = clock() + FIRST_S
    while not read_word(bus, address, register) & bit:
        if clock() > until:
            raise InterfaceError(f"0x{address:02x} on {bus.path}: no conversion within {FIRST_S} s", "check its supply")


def _identify(bus: Transfer, address: int, kind: str, chip: PowerChip) -> None:
    """Raise InterfaceError if the chip reports another type of KINDS. Other values are accepted: clones report any."""
    if chip.die is None:
        return
    die = read_word(bus, address, DIE)
    for other, another in KINDS.items():
        if other != kind and die == another.die:
            raise InterfaceError(
                f"0x{address:02x} on {bus.path} is an {other.upper()}, not an {kind.upper()}",
                f'give kind = "{other}" in the board file',
            )


def _value(word: int, shift: int, is_signed: bool) -> int:
    return (word - 0x10000 if is_signed and word & 0x8000 else word) >> shift
