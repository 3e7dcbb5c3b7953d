"""Boot counters of the card: U-Boot's redundant environment in two raw copies.

Source: libubootenv, uboot_env.c: struct uboot_env_redund, libuboot_load.
"""

import struct
import zlib
from collections.abc import Iterable
from typing import NamedTuple

SIZE = 0x1000  # octets of a copy: small, for the boot script reads it; the text fits the first sector
APART = 4 << 20  # octets between the copies: a power cut may destroy a whole erase block of the card
NONE = "0"  # value of BOOT_NEW and BOOT_AGAIN for no slot; a variable with an empty value would be absent
WORDS = ("BOOT_ORDER", "BOOT_A_LEFT", "BOOT_B_LEFT", "BOOT_NEW", "BOOT_AGAIN")  # the boot script drops others
_HEAD = struct.Struct("<IB")  # CRC-32 of the text; a counter of writes, which wraps from 255 to 0


class State(NamedTuple):
    """Boot order of the slots, and how many tries each has left.

    order   slots in the order of tries.
    a_left  tries left for slot A.
    b_left  tries left for slot B.
    new     the updated slot that is on trial.
    again   the slot that used up its tries, got one more, and has not proved itself since.
    """

    order: tuple[str, ...] = ("A", "B")
    a_left: int = 3
    b_left: int = 3
    new: str = NONE
    again: str = NONE

    @property
    def left(self) -> dict[str, int]:
        """Tries left, by slot."""
        return {"A": self.a_left, "B": self.b_left}


def packed(state: State, counter: int) -> bytes:
    """Encode one copy: CRC-32 of the text, counter, text."""
    values = (" ".join(state.order), f"{state.a_left:x}", f"{state.b_left:x}", state.new, state.again)
    words = "".join(f"{name}={value}\0" for name, value in zip(WORDS, values, strict=True))
    text = words.encode().ljust(SIZE - _HEAD.size, b"\0")
    return _HEAD.pack(zlib.crc32(text), counter) + text


def unpacked(copy: bytes) -> tuple[State, int] | None:
    """Decode state and counter of one copy; None if it was not written completely.

    An absent or empty variable has its default, as in the boot script; an invalid number means no tries left.
    """
    if len(copy) < _HEAD.size:
        return None
    crc, counter = _HEAD.unpack_from(copy)
    text = copy[_HEAD.size :]
    if zlib.crc32(text) != crc:
        return None
    words = dict(word.split("=", 1) for word in text.decode("ascii", "replace").split("\0") if "=" in word)
    order = tuple(words.get("BOOT_ORDER", "").split()) or State().order
    a_left, b_left = (_left(words.get(f"BOOT_{slot}_LEFT"), default) for slot, default in State().left.items())
    new, again = (words.get(name) or NONE for name in ("BOOT_NEW", "BOOT_AGAIN"))
    return State(order, a_left, b_left, new, again), counter


def newest(copies: Iterable[bytes]) -> State | None:
    """Return the state that was written last; None if no copy is valid, and the boot script starts with defaults."""
    found = [one for copy in copies if (one := unpacked(copy))]
    if not found:
        return None
    is_over = {counter for _, counter in found} == {0, 0xFF}  # the counter wrapped: 0 is newer than 255
    state, _ = (min if is_over else max)(found, key=lambda one: one[1])
    return state


def copies_in(partition: bytes) -> tuple[bytes, bytes]:
    """Return both copies from the octets of a partition."""
    return partition[:SIZE], partition[APART : APART + SIZE]


def blank() -> bytes:
    """Return the partition of a new card, up to the end of the second copy."""
    return packed(State(), 1).ljust(APART, b"\0") + packed(State(), 0)


def _left(word: str | None, default: int) -> int:
    try:
        return int(word, 16) if word else default
    except ValueError:
        return 0
