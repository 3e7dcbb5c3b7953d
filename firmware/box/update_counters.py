"""The boot counters of the card, as the boot script and libubootenv keep them: twice, and one copy is always whole."""

import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from board.errors import StationError

CONFIGURATION = Path("/etc/fw_env.config")  # device, offset, size; a line for each copy
_HEAD = 5  # octets: CRC-32 of the text, and a counter that goes up by one with each write, from 255 to 0


class Counters(NamedTuple):
    """order: slots as they are tried. left: tries by slot. new: a slot that was updated and has not been well yet."""

    order: tuple[str, ...]
    left: Mapping[str, int]
    new: str


def read(configuration: Path = CONFIGURATION) -> Counters:
    """Those of now. Raises StationError."""
    copies = []
    try:
        for line in configuration.read_text().splitlines():
            words = line.split()
            if len(words) == 3 and not line.startswith("#"):
                copies.append(_octets(words[0], int(words[1], 16), int(words[2], 16)))
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise StationError(f"the boot counters cannot be read: {why}", "ask as operator, or as root") from error
    return newest(copies)


def newest(copies: list[bytes]) -> Counters:
    """Of the copies that are whole, the one that was written last; the boot script begins anew where there is none.

    Source: libubootenv, uboot_env.c, libuboot_load.
    """
    whole = [copy for copy in copies if zlib.crc32(copy[_HEAD:]) == int.from_bytes(copy[:4], "little")]
    if not whole:
        return _of({})
    if {copy[4] for copy in whole} == {0, 0xFF}:
        chosen = min(whole, key=lambda copy: copy[4])
    else:
        chosen = max(whole, key=lambda copy: copy[4])
    text = chosen[_HEAD:].decode("ascii", "replace")
    return _of(dict(word.split("=", 1) for word in text.split("\0") if "=" in word))


def _of(words: Mapping[str, str]) -> Counters:
    left = {}
    for slot in ("A", "B"):
        try:
            left[slot] = int(words.get(f"BOOT_{slot}_LEFT", "3"), 16)
        except ValueError:
            left[slot] = 0
    return Counters(tuple(words.get("BOOT_ORDER", "A B").split()), left, words.get("BOOT_NEW", "0").strip("0"))


def _octets(path: str, offset: int, size: int) -> bytes:
    device = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        return os.pread(device, size, offset)
    finally:
        os.close(device)
