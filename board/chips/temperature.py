"""TMP102: temperature in 12 bits, or in 13 bits in its extended mode."""

from board.i2c import Transfer, read_word
from board.runtime.errors import InterfaceError

TEMPERATURE = 0
CONFIGURATION = 1

# Bits of the configuration (SBOS397, table 8).
SHUTDOWN = 1 << 8
EXTENDED = 1 << 4

DEGREES = 0.0625  # degrees Celsius of one unit, in both modes


def read(bus: Transfer, address: int) -> float:
    """Return degrees Celsius, -55 to 150.

    Raises InterfaceError if the chip does not answer. Raises it too for a chip in shutdown: this wakes the chip,
    because its old reading is not valid.
    """
    configuration = read_word(bus, address, CONFIGURATION)
    if configuration & SHUTDOWN:
        woken = (configuration & ~SHUTDOWN).to_bytes(2, "big")
        bus.transfer(address, bytes([CONFIGURATION]) + woken, 0)
        raise InterfaceError(f"0x{address:02x} on {bus.path} was in shutdown mode, and is started", "retry after 35 ms")
    return celsius(read_word(bus, address, TEMPERATURE), bool(configuration & EXTENDED))


def celsius(word: int, is_extended: bool) -> float:
    """Return degrees Celsius of a temperature register: left-justified, 1/16 degree per unit."""
    signed = word - 0x10000 if word & 0x8000 else word
    return (signed >> (3 if is_extended else 4)) * DEGREES
