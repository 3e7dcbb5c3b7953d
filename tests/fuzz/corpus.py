"""Committed corpus: a text file per target, one hexadecimal input a line.

Valid messages, real and made ones, are above the blank line; they stay. Findings of fuzzing are below it.
"""

import hashlib
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMITTED = ROOT / "tests" / "asn1" / "corpus"
# What is kept of the inputs that reach new code: the shortest. All targets together stay below 300 kB.
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
    """All inputs of a target; none where it has no file."""
    return [*seeds(target), *_blocks(target)[1]]


def seeds(target: str) -> list[bytes]:
    """Those that stay."""
    return _blocks(target)[0]


def write(target: str, inputs: Iterable[bytes]) -> int:
    """Replace what fuzzing has found by the shortest of the inputs; the count of them."""
    staying = seeds(target)
    found = {octets for octets in inputs if len(octets) <= MAX_OCTETS} - set(staying)
    kept = sorted(found, key=lambda octets: (len(octets), octets))[:MAX_INPUTS]
    COMMITTED.mkdir(parents=True, exist_ok=True)
    (COMMITTED / f"{target}.hex").write_text(_lines(staying) + "\n" + _lines(kept))
    return len(kept)


def _blocks(target: str) -> tuple[list[bytes], list[bytes]]:
    path = COMMITTED / f"{target}.hex"
    if not path.exists():
        return [], []
    above, _, below = path.read_text().partition("\n\n")
    return [bytes.fromhex(line) for line in above.split()], [bytes.fromhex(line) for line in below.split()]


def _lines(inputs: Iterable[bytes]) -> str:
    return "".join(octets.hex() + "\n" for octets in inputs)
