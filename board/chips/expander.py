"""PCA9555, TCA9555 and compatible expanders: sixteen pins in four pairs of registers.

The state of a pin is read from the chip each time. The chip keeps it when the station restarts, and other programs
may change it. Only the register of the pin's own port is written, so the other eight pins never change.
"""

from board.i2c import Transfer
from board.runtime.errors import InterfaceError

# Registers of pins 0 to 7; the register of pins 8 to 15 follows each. NXP PCA9555, table 4.
INPUT = 0
OUTPUT = 2
POLARITY = 4  # bit 1: the pin reads inverted in INPUT
DIRECTION = 6  # bit 1: the pin is an input


def set_level(bus: Transfer, address: int, pin: int, is_high: bool, open_drain: bool = False) -> None:
    """Set a pin, 0 to 15, high or low. With open_drain, a high pin becomes an input instead.

    The output latch is written before the direction, so a new output starts at its level. A register that already
    holds the bit is not written. Raises InterfaceError if a register does not keep the value, or the pin does not
    follow.
    """
    is_driven = not (open_drain and is_high)
    if is_driven:
        _write(bus, address, OUTPUT, pin, is_high)
    _write(bus, address, DIRECTION, pin, not is_driven)
    if is_driven and level(bus, address, pin) != is_high:
        words = ("low", "high")
        raise InterfaceError(
            f"pin {pin} of 0x{address:02x} on {bus.path}: set {words[is_high]}, but reads {words[not is_high]}",
            "another chip drives the pin, or it is shorted: measure it, and compare the board file with the circuit",
        )


def level(bus: Transfer, address: int, pin: int) -> bool:
    """Return whether a pin is high, measured at the pin. The read clears the chip's interrupt, which is not used."""
    return _read(bus, address, INPUT, pin) != _read(bus, address, POLARITY, pin)


def _read(bus: Transfer, address: int, pair: int, pin: int) -> bool:
    return bool(_octet(bus, address, pair + pin // 8) >> pin % 8 & 1)


def _write(bus: Transfer, address: int, pair: int, pin: int, bit: bool) -> None:
    register, mask = pair + pin // 8, 1 << pin % 8
    now = _octet(bus, address, register)
    wanted = now | mask if bit else now & ~mask
    if wanted == now:
        return
    bus.transfer(address, bytes([register, wanted]), 0)
    now = _octet(bus, address, register)
    if now != wanted:
        raise InterfaceError(
            f"0x{address:02x} on {bus.path}: register {register} reads 0x{now:02x} after 0x{wanted:02x} was written",
            "check that it is a PCA9555, as in the board file",
        )


def _octet(bus: Transfer, address: int, register: int) -> int:
    return bus.transfer(address, bytes([register]), 1)[0]
