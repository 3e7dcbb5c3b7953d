"""TMP102: degrees Celsius in 12 bits, or in 13 where its extended mode is on."""

from board.errors import InterfaceError
from board.i2c import Transfer

TEMPERATURE = 0
CONFIGURATION = 1

# Bits of the configuration (SBOS397, table 8).
SHUTDOWN = 1 << 8
EXTENDED = 1 << 4

DEGREES = 0.0625  # of one unit in both modes


def read(bus: Transfer, address: int) -> float:
    """Degrees Celsius, -55 to 150.

    Raises InterfaceError also for a chip that was shut down: it is woken, and what it held is not told.
    """
    configuration = _word(bus, address, CONFIGURATION)
    if configuration & SHUTDOWN:
        woken = (configuration & ~SHUTDOWN).to_bytes(2, "big")
        bus.transfer(address, bytes([CONFIGURATION]) + woken, 0)
        raise InterfaceError(f"0x{address:02x} on {bus.path} was shut down, and is woken", "read it again in 35 ms")
    return celsius(_word(bus, address, TEMPERATURE), bool(configuration & EXTENDED))


def celsius(word: int, is_extended: bool) -> float:
    """Degrees of a temperature register: the unit is 1/16 degree, left-justified."""
    signed = word - 0x10000 if word & 0x8000 else word
    return (signed >> (3 if is_extended else 4)) * DEGREES


def _word(bus: Transfer, address: int, register: int) -> int:
    return int.from_bytes(bus.transfer(address, bytes([register]), 2), "big")
