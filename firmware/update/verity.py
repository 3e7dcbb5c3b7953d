"""Hash tree of a bundle: verifies each octet before anything is written.

The kernel verifies the same tree again, block by block, during the installation: later changes are detected.
"""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from board.runtime.errors import StationError

BLOCK = 4096
DIGEST = 32
AT_ONCE = 256 * BLOCK
SIZE_FIELD = 8  # octets at the end of a bundle: length of the signature before them, big-endian
DAMAGED = "it was changed or damaged after it was signed; fetch it again"


class Tree(NamedTuple):
    """Hash tree of a bundle by its signed manifest. size: octets of the tree; root and salt in hexadecimal."""

    size: int
    root: str
    salt: str


def check(path: Path, name: str, tree: Tree, seen: Callable[[float], None] = lambda part: None) -> None:
    """Verify a bundle's contents. Raises StationError if an octet of the contents, or of the tree, differs.

    name  name that the user gave, for messages.
    seen  called with the progress, 0 to 1.

    Source: the kernel's Documentation/admin-guide/device-mapper/verity.rst, hash type 1, SHA-256; RAUC's reference,
    "Bundle formats", verity.
    """
    total = path.stat().st_size
    with path.open("rb") as file:
        file.seek(-SIZE_FIELD, os.SEEK_END)
        signature = int.from_bytes(file.read(SIZE_FIELD), "big")
        content = total - SIZE_FIELD - signature - tree.size
        if content <= 0 or content % BLOCK:
            raise StationError(f"{name}: {total} octets do not match its signature", DAMAGED)
        file.seek(0)
        salted = hashlib.sha256(bytes.fromhex(tree.salt))
        digests = bytearray()
        for at in range(0, content, AT_ONCE):
            digests += _digests(salted, file.read(min(AT_ONCE, content - at)))
            seen(min(1.0, (at + AT_ONCE) / content))
        levels = [_padded(bytes(digests))]
        while len(levels[0]) > BLOCK:
            levels.insert(0, _padded(_digests(salted, levels[0])))
        if _digests(salted, levels[0]).hex() != tree.root or file.read(tree.size) != b"".join(levels):
            raise StationError(f"{name}: its contents do not match its signature", DAMAGED)


def _digests(salted: "hashlib._Hash", octets: bytes) -> bytes:
    """Return the concatenated digests of all blocks."""
    found = bytearray()
    view = memoryview(octets)
    for at in range(0, len(octets), BLOCK):
        block = salted.copy()
        block.update(view[at : at + BLOCK])
        found += block.digest()
    return bytes(found)


def _padded(digests: bytes) -> bytes:
    return digests + bytes(-len(digests) % BLOCK)
