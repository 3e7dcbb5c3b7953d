"""Verifies the boot partition: as described, octet for octet."""

import re
import tempfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from image.description import Description
from image.parts import boot
from image.parts.kernel import Kernel
from image.tool import run
from image.verify import tree

# Source: U-Boot, include/image.h: struct legacy_img_hdr; the length of a script and a 0 precede its text.
HEAD, BEFORE_TEXT = 64, 8
MAGIC = bytes.fromhex("27051956")
SCRIPT, CONFIG = "boot.scr", "config.txt"
# Unsubstituted @PLACEHOLDER@.
WORD = re.compile(rb"@[A-Z_]{3,}@")


def checks(described: Description, partition: str, kernel: Kernel) -> Iterator[tuple[str, str]]:
    """Yield each check with its trouble, which is empty if it passed.

    partition  FILE@@OFFSET, mtools' form.
    kernel     unpacked packages from which the card was made.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(["mcopy", "-n", "-s", "-Q", "-i", partition, "::*", folder], environment={"MTOOLS_SKIP_CHECK": "1"})
        yield from compared(described, folder, kernel)


def compared(described: Description, folder: Path, kernel: Kernel) -> Iterator[tuple[str, str]]:
    """Check the partition's files in a folder; yield as checks()."""
    there = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    packed = {name: kernel.folder / described.firmware.folder / name for name in described.firmware.files}
    packed[boot.LOADER] = kernel.folder / described.loader.file
    ours = {path.relative_to(boot.FILES).as_posix(): path for path in boot.FILES.rglob("*") if path.is_file()}
    trees = described.device_tree.files
    is_changed = described.device_tree.way == "dtc"  # else the firmware changes the trees at the start
    if not is_changed:
        packed |= {name: kernel.device_tree(described.device_tree.folder, name) for name in trees}
        overlays = kernel.device_tree(boot.OVERLAYS, "")
        packed |= {f"{boot.OVERLAYS}/{path.name}": path for path in overlays.iterdir()}
    wanted = {*packed, *ours, *trees, SCRIPT, CONFIG}
    missing, more = sorted(wanted - there), sorted(there - wanted)
    yield "files of the firmware", f"{missing} are not there" if missing else ""
    yield "nothing else is on the boot partition", f"{more} are" if more else ""
    for what, files in (("firmware, loader and trees are the packages'", packed), ("files for a person", ours)):
        other = [name for name, path in sorted(files.items())
                 if name in there and (folder / name).read_bytes() != path.read_bytes()]  # fmt: skip
        yield what, f"{other} are others" if other else ""
    for name, trouble in ((SCRIPT, _script), (CONFIG, _config)):
        octets = (folder / name).read_bytes() if name in there else b""
        found = WORD.findall(octets)
        yield f"no word is left open in {name}", f"{found[0].decode()} is" if found else ""
        yield f"{name} is that of the description", trouble(described, octets)
    if is_changed:
        for name in trees:
            get = tree.reader(folder / name)
            yield f"the device tree {name}", "; ".join(tree.troubles(described, get))


def _script(described: Description, octets: bytes) -> str:
    head, body = octets[:HEAD], octets[HEAD:]
    if head[:4] != MAGIC or zlib.crc32(body).to_bytes(4, "big") != head[24:28]:
        return "U-Boot would not run it"
    return "" if body[BEFORE_TEXT:] == boot.script(described).encode() else "its text is another"


def _config(described: Description, octets: bytes) -> str:
    return "" if octets == boot.config(described).encode() else "its text is another"
