"""The bits of a message, one row for each thing that they say."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from firmware.codec.library import Step

MOST_BITS = 16  # of a value that are shown as bits; longer ones have hexadecimal digits
MOST_DIGITS = 32
INDENT = " "  # a terminal of 80 columns has little room

# What the encoding holds beside values: said in the words of X.691.
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
    """bit and width as in Step; depth: how many containers it stands in; bits: what they are."""

    bit: int
    width: int
    depth: int
    name: str
    path: str
    value: str
    bits: str
    clause: str


def rows(octets: bytes, steps: Sequence[Step]) -> Iterator[Row]:
    """Containers have a row without bits, what they hold follows one level deeper."""
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
    """A stretch of bits as text; a long one in hexadecimal digits, its last one filled up with zeros."""
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
