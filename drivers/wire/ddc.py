"""I2C interface of a u-blox receiver (DDC): three registers give access to the stream of its port.

    fd, fe  number of octets available in the stream; the upper eight bits come first
    ff      the stream; after its end every read returns ff

A write of two or more octets goes to the receiver as a message. A write of a single octet only selects a register.
Source: u-blox F9 integration manual, clause 3.7 (I2C interface).
"""

from typing import Protocol

ADDRESS = 0x42  # default of CFG-I2C-ADDRESS
MOST = 256  # octets of one transfer: it occupies the bus for 6 ms at 400 kHz; then other devices can use it

_AVAILABLE, _STREAM = b"\xfd", b"\xff"


class Transfer(Protocol):
    """I2C bus. transfer() writes octets, then reads a number of octets, between one start and one stop condition."""

    def transfer(self, address: int, write: bytes, read: int) -> bytes: ...


class Ddc:
    """Octet stream of a u-blox receiver at an I2C bus."""

    def __init__(self, bus: Transfer, address: int = ADDRESS) -> None:
        self._bus = bus
        self._address = address

    def read(self) -> bytes:
        """Return the available octets, at most MOST. Passes on the exceptions of the bus."""
        waiting = int.from_bytes(self._bus.transfer(self._address, _AVAILABLE, 2))
        if waiting in (0, 0xFFFF):  # a receiver answers ffff while it starts
            return b""
        return self._bus.transfer(self._address, _STREAM, min(waiting, MOST))

    def write(self, octets: bytes) -> None:
        """Write a frame, of at least two octets, to the receiver. Passes on the exceptions of the bus."""
        assert len(octets) > 1
        while octets:
            # A write of a single octet would select a register instead, so no part has one octet.
            size = MOST - 1 if len(octets) == MOST + 1 else MOST
            self._bus.transfer(self._address, octets[:size], 0)
            octets = octets[size:]
