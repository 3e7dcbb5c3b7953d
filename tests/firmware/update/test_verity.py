"""A bundle's contents against its signed hash tree, as the build machine's rauc makes it."""

import os
import random
import re
import subprocess
from pathlib import Path

import pytest

from board.runtime.errors import StationError
from firmware.update.verity import BLOCK, Tree, check
from image.card import bundle, keys

EPOCH = 1_700_000_000


def signed(folder: Path, size: int) -> tuple[Path, Tree]:
    """A bundle with so many octets that nothing makes shorter, and its tree by rauc's word."""
    contents = folder / "contents"
    contents.mkdir()
    (contents / bundle.NAME).write_bytes(random.Random(size).randbytes(size))
    signer = keys.development(folder / "keys", EPOCH)
    path = folder / "update.raucb"
    bundle.write(contents, "captain trixie quad", "1.2.3", EPOCH, signer, path)
    words = ["rauc", f"--keyring={signer.keyring}", "info", path]
    told = subprocess.run(words, capture_output=True, text=True, check=True, env={**os.environ, "LC_ALL": "C"}).stdout
    found = {key: re.search(rf"Verity {key}:\s+'?([0-9a-f]+)'?", told) for key in ("Size", "Hash", "Salt")}
    size_, root, salt = (match[1] for match in found.values() if match)
    return path, Tree(int(size_), root, salt)


# One level of digests, and two: a block holds 128 of them.
@pytest.fixture(scope="module", params=[100_000, 3_000_000])
def update(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Tree]:
    return signed(tmp_path_factory.mktemp("bundle"), request.param)


def test_bundle_that_is_whole_is_taken_with_its_progress(update: tuple[Path, Tree]):
    seen: list[float] = []
    check(update[0], "x", update[1], seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


@pytest.mark.parametrize("part", [0.0, 0.001, 0.3, 0.5, 0.9])
def test_bundle_with_another_bit_in_its_contents_is_refused(update: tuple[Path, Tree], tmp_path: Path, part: float):
    path, tree = update
    octets = bytearray(path.read_bytes())
    content = len(octets) - 8 - int.from_bytes(octets[-8:], "big") - tree.size
    octets[int(content * part)] ^= 0x10
    damaged = tmp_path / "damaged.raucb"
    damaged.write_bytes(octets)
    with pytest.raises(StationError, match=r"^x: its contents "):
        check(damaged, "x", tree)


def test_bundle_with_another_bit_in_its_tree_is_refused(update: tuple[Path, Tree], tmp_path: Path):
    path, tree = update
    octets = bytearray(path.read_bytes())
    at = len(octets) - 8 - int.from_bytes(octets[-8:], "big") - tree.size
    for place in (at, at + tree.size - 1):
        changed = octets.copy()
        changed[place] ^= 1
        damaged = tmp_path / "damaged.raucb"
        damaged.write_bytes(changed)
        with pytest.raises(StationError, match=r"^x: its contents "):
            check(damaged, "x", tree)


@pytest.mark.parametrize("cut", [1, 8, BLOCK, 50_000])
def test_bundle_that_ends_too_early_is_refused(update: tuple[Path, Tree], tmp_path: Path, cut: int):
    path, tree = update
    short = tmp_path / "short.raucb"
    short.write_bytes(path.read_bytes()[:-cut])
    with pytest.raises(StationError):
        check(short, "x", tree)
