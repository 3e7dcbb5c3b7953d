"""A u-blox receiver at an I2C bus (u-blox calls it DDC): three registers, behind which is the stream of its port.

    fd, fe  octets that wait in the stream, the upper eight bits first
    ff      the stream; beyond its end it reads ff for ever

What is written from the second octet on goes into the receiver; a single octet only chooses a register.
Source: u-blox F9 integration manual, clause 3.7 (I2C interface).
"""

from typing import Protocol

ADDRESS = 0x42  # unless CFG-I2C-ADDRESS says otherwise
MOST = 256  # octets of one transfer: 6 ms at 400 kHz, so that others at the bus have their turn

_AVAILABLE, _STREAM = b"\xfd", b"\xff"


class Transfer(Protocol):
    """A bus: write, then read so many octets, between one start and one stop."""

    def transfer(self, address: int, write: bytes, read: int) -> bytes: ...


class Ddc:
    """The stream of a receiver behind its registers."""

    def __init__(self, bus: Transfer, address: int = ADDRESS) -> None:
        self._bus = bus
        self._address = address

    def read(self) -> bytes:
        """What waits, at most MOST octets. Raises what the bus raises."""
        waiting = int.from_bytes(self._bus.transfer(self._address, _AVAILABLE, 2))
        if waiting in (0, 0xFFFF):  # a receiver that starts says ffff
            return b""
        return self._bus.transfer(self._address, _STREAM, min(waiting, MOST))

    def write(self, octets: bytes) -> None:
        """A frame into the receiver. Raises what the bus raises."""
        assert len(octets) > 1
        while octets:
            # No part may be a single octet: it would choose a register.
            size = MOST - 1 if len(octets) == MOST + 1 else MOST
            self._bus.transfer(self._address, octets[:size], 0)
            octets = octets[size:]
