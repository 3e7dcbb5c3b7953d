"""The boot counters, as the boot script and libubootenv keep them: twice, raw, in a partition of their own."""

import struct
import zlib
from typing import NamedTuple

SIZE = 0x1000  # octets of a copy: so many that the script has to read few, and all that is said fits its first sector
APART = 4 << 20  # octets: what one erase block of a card may take with it
_HEAD = struct.Struct("<IB")


NONE = "0"  # a variable without a value is none
WORDS = ("BOOT_ORDER", "BOOT_A_LEFT", "BOOT_B_LEFT", "BOOT_NEW", "BOOT_AGAIN")  # others the boot script drops


class State(NamedTuple):
    """Which slots are tried, in this order, and how often each still may be.

    new    the slot that was updated and has not been well yet.
    again  the slot that had used its tries up, was given one more, and has not been well since.
    """

    order: tuple[str, ...] = ("A", "B")
    a_left: int = 3
    b_left: int = 3
    new: str = NONE
    again: str = NONE


def packed(state: State, counter: int) -> bytes:
    """A copy: CRC-32 of the text, a counter, the text. Source: libubootenv, redundant environment."""
    values = (" ".join(state.order), f"{state.a_left:x}", f"{state.b_left:x}", state.new, state.again)
    words = "".join(f"{name}={value}\0" for name, value in zip(WORDS, values, strict=True))
    text = words.encode().ljust(SIZE - _HEAD.size, b"\0")
    return _HEAD.pack(zlib.crc32(text), counter) + text


def unpacked(octets: bytes) -> tuple[State, int] | None:
    """A state and its counter; None for a copy that was not written whole."""
    crc, counter = _HEAD.unpack_from(octets)
    text = octets[_HEAD.size : SIZE]
    if zlib.crc32(text) != crc:
        return None
    words = dict(word.split("=", 1) for word in text.decode("ascii", "replace").split("\0") if "=" in word)
    try:
        a_left, b_left = (int(words[key], 16) for key in ("BOOT_A_LEFT", "BOOT_B_LEFT"))
        new, again = (words.get(key, NONE) for key in ("BOOT_NEW", "BOOT_AGAIN"))
        return State(tuple(words["BOOT_ORDER"].split()), a_left, b_left, new, again), counter
    except (KeyError, ValueError):
        return None


def newest(partition: bytes) -> State | None:
    """What the boot script goes by; None: neither copy is whole, and it begins with all tries."""
    found = [copy for at in (0, APART) if (copy := unpacked(partition[at : at + SIZE]))]
    if len(found) == 2 and {found[0][1], found[1][1]} == {0, 0xFF}:  # the counter goes on at 0
        return min(found, key=lambda copy: copy[1])[0]
    return max(found, key=lambda copy: copy[1])[0] if found else None


def blank() -> bytes:
    """The partition of a new card: its length is up to the second copy's end."""
    return packed(State(), 1).ljust(APART, b"\0") + packed(State(), 0)
