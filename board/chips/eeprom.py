"""24C32: octets behind a word address of 16 bits.

Never to be read as one reads registers: an address of 8 bits is the first half of one to them, and a *write* of a
register is then a write into the memory.
"""

import time
from collections.abc import Callable

from board.errors import InterfaceError, RequestError
from board.i2c import Transfer

SIZE = 4096  # octets of a 24C32
PAGE = 32  # octets that are written at once; a write beyond the end of a page wraps to its beginning
CYCLE_S = 0.02  # of a write, for which it does not answer: 5 ms, or 10 of the oldest


def read(bus: Transfer, address: int, offset: int, length: int) -> bytes:
    """Octets from an offset, in one transaction: 100 us each at 100 kHz."""
    return bus.transfer(address, offset.to_bytes(2, "big"), length)


def write(bus: Transfer, address: int, offset: int, octets: bytes, clock: Callable[[], float] = time.monotonic) -> None:
    """Write octets page by page, and read them back.

    Raises RequestError for octets beyond the end, which would go to the beginning; InterfaceError when a page is not
    written within CYCLE_S, or does not hold what was written: its pin WP protects it.
    """
    if offset + len(octets) > SIZE:
        raise RequestError(f"{len(octets)} octets at {offset} do not fit in the {SIZE} of an EEPROM")
    for begin, end in _pages(offset, len(octets)):
        bus.transfer(address, begin.to_bytes(2, "big") + octets[begin - offset : end - offset], 0)
        _await_answer(bus, address, clock)
    if read(bus, address, offset, len(octets)) != octets:
        raise InterfaceError(
            f"0x{address:02x} on {bus.path}: {len(octets)} octets at {offset} are not what was written",
            "its pin WP protects it: close the jumper that pulls it low",
        )


def _pages(offset: int, length: int) -> list[tuple[int, int]]:
    """Begin and end of the pieces of a range that do not cross a page."""
    end = offset + length
    begins = [offset, *range((offset // PAGE + 1) * PAGE, end, PAGE)] if length else []
    return [(begin, min((begin // PAGE + 1) * PAGE, end)) for begin in begins]


def _await_answer(bus: Transfer, address: int, clock: Callable[[], float]) -> None:
    """Ask until it answers again; each question takes its time on the bus. A read of one octet changes nothing."""
    until = clock() + CYCLE_S
    while True:
        try:
            bus.transfer(address, b"", 1)
        except InterfaceError as error:
            if clock() > until:
                raise InterfaceError(
                    f"0x{address:02x} on {bus.path}: a page is not written within {CYCLE_S} s: {error.message}",
                    error.hint,
                ) from error
        else:
            return
