"""Bits of a message as rows: one per field, length, presence bit or choice."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from firmware.codec.library import Step

MOST_BITS = 16  # longest value that is shown as bits; longer ones are shown as hexadecimal digits
MOST_DIGITS = 32
INDENT = " "  # one blank per level, because a terminal has 80 columns

# Names of bits other than values, in the terms of X.691.
_SAYS = {
    "extension bit": "(extension bit)",
    "presence": "(presence)",
    "length": "(length)",
    "choice": "(choice)",
    "open": "(open type)",
    "unknown": "(unknown addition)",
    "padding": "(padding)",
}


class Row(NamedTuple):
    """A row of the table.

    bit, width  as in Step.
    depth       number of enclosing containers.
    bits        the bits as text.
    """

    bit: int
    width: int
    depth: int
    name: str
    path: str
    value: str
    bits: str
    clause: str


def rows(octets: bytes, steps: Sequence[Step]) -> Iterator[Row]:
    """Yield a row for each step. A container has a row without bits; its contents follow one level deeper."""
    depth = 0
    for step in steps:
        if step.what == "leave":
            depth -= 1
            continue
        name = step.path.rpartition(".")[2]
        value = step.type if step.what == "enter" else step.text
        if step.what not in ("enter", "value"):
            name = _SAYS.get(step.what, f"({step.what})")
        yield Row(step.bit, step.width, depth, name, step.path, value, shown(octets, step.bit, step.width), step.clause)
        if step.what == "enter":
            depth += 1


def shown(octets: bytes, bit: int, width: int) -> str:
    """Return bits as text; many bits as hexadecimal digits, the last one padded with zeros."""
    if not width:
        return ""
    first, end = bit // 8, (bit + width + 7) // 8
    there = octets[first:end].ljust(end - first, b"\0")
    number = int.from_bytes(there) >> (8 * end - bit - width) & (1 << width) - 1
    if width <= MOST_BITS:
        return f"{number:0{width}b}"
    digits = (width + 3) // 4
    text = f"{number << (4 * digits - width):0{digits}x}"
    return f"0x{text[:MOST_DIGITS]}{'..' if digits > MOST_DIGITS else ''}"
