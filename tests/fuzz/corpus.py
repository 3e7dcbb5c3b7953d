"""The committed corpus: per target a text file, one input a line in hexadecimal. Small, and readable in a diff."""

import hashlib
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMITTED = ROOT / "tests" / "asn1" / "corpus"
# What is kept per target: inputs that reach new code, the shortest first; all targets together stay below 300 kB.
MAX_INPUTS = 60
MAX_OCTETS = 96


def unpack(target: str, folder: Path) -> int:
    """One file per committed input, named by its digest as libFuzzer does; the count of them."""
    folder.mkdir(parents=True, exist_ok=True)
    inputs = read(target)
    for octets in inputs:
        (folder / hashlib.sha1(octets).hexdigest()).write_bytes(octets)
    return len(inputs)


def read(target: str) -> list[bytes]:
    path = COMMITTED / f"{target}.hex"
    return [bytes.fromhex(line) for line in path.read_text().splitlines()] if path.exists() else []


def write(target: str, inputs: Iterable[bytes]) -> int:
    """Keep what was there and is longer (real messages), and the shortest of the inputs; the count of them."""
    real = {octets for octets in read(target) if len(octets) > MAX_OCTETS}
    short = sorted({octets for octets in inputs if len(octets) <= MAX_OCTETS}, key=lambda octets: (len(octets), octets))
    kept = [*short[:MAX_INPUTS], *sorted(real)]
    COMMITTED.mkdir(parents=True, exist_ok=True)
    (COMMITTED / f"{target}.hex").write_text("".join(octets.hex() + "\n" for octets in kept))
    return len(kept)
