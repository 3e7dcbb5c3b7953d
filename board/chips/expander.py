"""PCA9555, TCA9555 and their like: sixteen pins behind four pairs of registers.

What a pin is set to is read from the chip each time and not remembered: the chip keeps its state when we are started
anew, and others may have set it. Of a pair only the register of the pin's own port is written, so that the other
eight pins are never touched.
"""

from board.errors import InterfaceError
from board.i2c import Transfer

# Registers of pins 0 to 7; those of 8 to 15 follow each. NXP PCA9555, table 4.
INPUT = 0
OUTPUT = 2
POLARITY = 4  # 1: INPUT reads inverted
DIRECTION = 6  # 1: input


def set_level(bus: Transfer, address: int, pin: int, is_high: bool, open_drain: bool = False) -> None:
    """Drive a pin, 0 to 15; with open_drain only low, and let go of it for high.

    The latch is written before the direction: a pin that becomes an output begins with its level. A register that
    holds its bit already is not written at all. Raises InterfaceError when a register does not keep what is written,
    or the pin does not follow.
    """
    is_driven = not (open_drain and is_high)
    if is_driven:
        _write(bus, address, OUTPUT, pin, is_high)
    _write(bus, address, DIRECTION, pin, not is_driven)
    if is_driven and level(bus, address, pin) != is_high:
        words = ("low", "high")
        raise InterfaceError(
            f"pin {pin} of 0x{address:02x} on {bus.path}: set {words[is_high]} and reads {words[not is_high]}",
            "something else drives it, or it is shorted: measure it, and compare the board file with the circuit",
        )


def level(bus: Transfer, address: int, pin: int) -> bool:
    """Whether a pin is high, measured at the pin. It clears the chip's interrupt, which nobody here waits for."""
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
            f"0x{address:02x} on {bus.path}: register {register} was set to 0x{wanted:02x} and reads 0x{now:02x}",
            "is it a PCA9555? compare the board file with what is fitted",
        )


def _octet(bus: Transfer, address: int, register: int) -> int:
    return bus.transfer(address, bytes([register]), 1)[0]
