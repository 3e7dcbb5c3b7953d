"""Updates of a card for the proof: a good one, ones that fail and that hang, and each way to be spoiled."""

import dataclasses
import hashlib
import os
import subprocess
from pathlib import Path
from typing import NamedTuple

from image.card import bundle, keys
from image.description import Description, read
from image.filesystem import disk
from image.own_files import OVERLAY
from image.tool import run

PROJECT = Path(__file__).resolve().parents[3]
MADE = PROJECT / "build/image"
TOOLS = MADE / "tools"
# Made in seconds; how small they get is no matter here.
FAST = "-comp zstd -Xcompression-level 1"
GOOD, BROKEN, HANGING = "9.1.0", "9.2.0", "9.2.1"  # versions
MARK = "usr/lib/captain-image/proof"  # a file that only the good update has
PROGRAM = "usr/lib/captain/captain"
FAILS = "#!/bin/sh\necho 'this version does not work' >&2\nexit 1\n"
FIREWALL = "usr/sbin/nft"  # what the start of any system waits for
HANGS = "#!/bin/sh\nexec sleep infinity\n"
LIMIT = "usr/lib/systemd/system/captain-unproven.timer"
CHUNK = 1 << 20
HANGING_S = 45  # emulated, by then all that a start begins with has begun
SOUND = "sound"
SIZE_OCTETS = 8  # of a bundle's end: how long the signature before it is
SMALL = 200_000  # octets of contents that are never installed


class Bundles(NamedTuple):
    """Files in one folder.

    broken   whose station fails.
    hanging  whose start comes to no end; it has not a quarter of an hour, but less than a minute.
    spoiled  file by what is wrong with it.
    sound    one with nothing wrong but its contents, which no slot could be started with.
    octets   of the good one's file system, and its SHA-256: what a slot holds that has it.
    """

    good: Path
    broken: Path
    hanging: Path
    spoiled: dict[str, Path]
    sound: Path
    octets: int
    digest: str


def made(card: Path, folder: Path, is_short: bool = False) -> Bundles:
    """is_short: the good one alone. Raises ImageError."""
    description = read(PROJECT / "image/image.toml")
    folder.mkdir()
    own = keys.chosen(MADE / "keys", 0)
    slot = folder / "slot"
    _slot(description, card, slot)
    good, contents = _changed(slot, folder, own, description, GOOD, {MARK: "here\n"})
    octets, digest = contents.stat().st_size, digest_of(contents)
    contents.unlink()
    if is_short:
        slot.unlink()
        return Bundles(good, good, good, {}, good, octets, digest)
    broken, contents = _changed(slot, folder, own, description, BROKEN, {PROGRAM: FAILS})
    contents.unlink()
    limit = (OVERLAY / LIMIT).read_text()
    assert "OnBootSec=15min" in limit
    files = {FIREWALL: HANGS, LIMIT: limit.replace("OnBootSec=15min", f"OnBootSec={HANGING_S}")}
    hanging, contents = _changed(slot, folder, own, description, HANGING, files)
    for path in (contents, slot):
        path.unlink()
    spoiled = _spoiled(good, folder, own, description)
    return Bundles(good, broken, hanging, spoiled, spoiled.pop(SOUND), octets, digest)


def digest_of(path: Path, at: int = 0, octets: int | None = None) -> str:
    """SHA-256 of a part of a file, or of all of it."""
    found = hashlib.sha256()
    with path.open("rb") as file:
        file.seek(at)
        left = path.stat().st_size - at if octets is None else octets
        while left > 0 and (part := file.read(min(left, CHUNK))):
            found.update(part)
            left -= len(part)
    return found.hexdigest()


def _slot(description: Description, card: Path, target: Path) -> None:
    """Slot A's file system, shrunk."""
    place = next(place for place in disk.places(description.disk) if place.partition.name == "root-a")
    whole = target.with_suffix(".whole")
    run(["dd", f"if={card}", f"of={whole}", "bs=1M", f"skip={place.start_mib}", f"count={place.partition.size_mib}",
         "conv=sparse", "status=none"])  # fmt: skip
    bundle.shrunk(whole, target, TOOLS, 0)
    whole.unlink()


def _changed(
    slot: Path, folder: Path, signer: keys.Keys, description: Description, version: str, files: dict[str, str]
) -> tuple[Path, Path]:
    """A bundle, and the file system in it."""
    contents = folder / version
    contents.mkdir()
    own = contents / bundle.NAME
    run(["cp", "--sparse=always", slot, own])
    for place, text in files.items():
        source = folder / "file"
        source.write_text(text)
        debugfs(own, [f"rm /{place}", f"write {source} /{place}", f"sif /{place} mode 0100755"])
    target = folder / f"captain-{version}-arm64.raucb"
    bundle.write(contents, description.compatible, version, 0, signer, target, FAST)
    return target, own


def debugfs(image: Path, commands: list[str], offset: int = 0) -> None:
    """Change files of a file system that lies in an image."""
    loader = next(TOOLS.glob("usr/lib/*/ld-linux*.so.*"))
    words = [loader, "--library-path", loader.parent, TOOLS / "usr/sbin/debugfs", "-w", "-f", "-"]
    run([*words, f"{image}?offset={offset}"], given="\n".join(commands) + "\n")


def _spoiled(good: Path, folder: Path, own: keys.Keys, description: Description) -> dict[str, Path]:
    small = folder / "small"
    small.mkdir()
    (small / bundle.NAME).write_bytes(os.urandom(SMALL))
    found = {}

    def signed(name: str, words: str, signer: keys.Keys) -> None:
        found[name] = folder / f"{name.replace(' ', '-')}.raucb"
        bundle.write(small, words, "9.3.0", 0, signer, found[name], FAST)

    signed(SOUND, description.compatible, own)
    signed("another signer", description.compatible, keys.development(folder / "foreign", 0))
    tree = dataclasses.replace(description.device_tree, uarts=(*description.device_tree.uarts, 4))
    signed("another device tree", dataclasses.replace(description, device_tree=tree).compatible, own)
    size = good.stat().st_size
    # The latter in the signature's own number: whatever else is hit, a name or a length, has words of its own.
    for name, at in (("contents changed", size // 2), ("signature changed", size - SIZE_OCTETS - 8)):
        found[name] = folder / f"{name.replace(' ', '-')}.raucb"
        subprocess.run(["cp", good, found[name]], check=True)
        with found[name].open("r+b") as file:
            file.seek(at)
            (octet,) = file.read(1)
            file.seek(at)
            file.write(bytes([octet ^ 0x04]))
    found["truncated"] = folder / "truncated.raucb"
    with good.open("rb") as file:
        found["truncated"].write_bytes(file.read(size // 3))
    return found
