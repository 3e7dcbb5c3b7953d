"""24C32: EEPROM with word addresses of 16 bits.

Never access it like a chip with 8-bit registers. It would take the register number as the first half of a word
address, and a register *write* would then write into the memory.
"""

import time
from collections.abc import Callable

from board.i2c import Transfer
from board.runtime.errors import InterfaceError, RequestError

SIZE = 4096  # octets of a 24C32
PAGE = 32  # octets of one page; a write beyond the end of a page continues at the beginning of the same page
CYCLE_S = 0.02  # limit for a write, during which the chip does not answer: 5 ms, or 10 ms for the oldest chips


def read(bus: Transfer, address: int, offset: int, length: int) -> bytes:
    """Return octets from an offset, read in one transaction; each takes 100 us at 100 kHz."""
    return bus.transfer(address, offset.to_bytes(2, "big"), length)


def write(bus: Transfer, address: int, offset: int, octets: bytes, clock: Callable[[], float] = time.monotonic) -> None:
    """Write octets page by page, then read them back and compare.

    Raises RequestError if the octets exceed the end, since the chip would wrap to its beginning. Raises
    InterfaceError if a page write exceeds CYCLE_S, or the octets differ: pin WP protects the chip.
    """
    if offset + len(octets) > SIZE:
        raise RequestError(f"{len(octets)} octets at {offset} do not fit in the {SIZE} of an EEPROM")
    for begin, end in _pages(offset, len(octets)):
        bus.transfer(address, begin.to_bytes(2, "big") + octets[begin - offset : end - offset], 0)
        _await_answer(bus, address, clock)
    if read(bus, address, offset, len(octets)) != octets:
        raise InterfaceError(
            f"0x{address:02x} on {bus.path}: {len(octets)} octets at {offset} differ from the written ones",
            "its pin WP protects it: close the jumper that pulls it low",
        )


def _pages(offset: int, length: int) -> list[tuple[int, int]]:
    """Split a range at the page boundaries; return begin and end of each piece."""
    end = offset + length
    begins = [offset, *range((offset // PAGE + 1) * PAGE, end, PAGE)] if length else []
    return [(begin, min((begin // PAGE + 1) * PAGE, end)) for begin in begins]


def _await_answer(bus: Transfer, address: int, clock: Callable[[], float]) -> None:
    """Read one octet, which changes nothing, until the chip answers. Raises InterfaceError after CYCLE_S."""
    until = clock() + CYCLE_S
    while True:
        try:
            bus.transfer(address, b"", 1)
        except InterfaceError as error:
            if clock() > until:
                raise InterfaceError(
                    f"0x{address:02x} on {bus.path}: timeout of a page write after {CYCLE_S} s: {error.message}",
                    error.hint,
                ) from error
        else:
            return
