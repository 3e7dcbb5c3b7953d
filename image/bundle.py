"""An update: the file system of a slot, signed, as a box takes it: build/captain-VERSION-ARCHITECTURE.raucb.

The same slot gives the same contents. What differs from bundle to bundle of one slot is what a signature is made of:
the salt of the hash tree, the time of signing, the signature itself.
"""

import os
import shutil
from datetime import UTC, datetime
from pathlib import Path

from image.errors import ImageError
from image.keys import Keys
from image.program import run

# Verity: what is read while it is installed is compared block by block. The older form trusts that nobody changes the
# file between the check and the reading.
_MANIFEST = """\
[update]
compatible={compatible}
version={version}
build={build}

[bundle]
format=verity

[image.rootfs]
filename={name}
"""
NAME = "root.ext4"
# Blocks of 1 MiB give what a higher level would: level 15 with 256 KiB is 2 % smaller, and takes nine times as long.
SQUASHFS = "-comp zstd -Xcompression-level 8 -b 1M"


def make(slot: Path, words: str, version: str, epoch: int, keys: Keys, tools: Path, target: Path) -> None:
    """A bundle of a slot's file system.

    words  that a box compares with its own: Description.compatible.
    epoch  of the build, in Unix seconds: the date of everything in the bundle.
    tools  folder of an unpacked e2fsprogs.

    Raises ImageError.
    """
    folder = target.with_suffix(".contents")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    shrunk(slot, folder / NAME, tools, epoch)
    write(folder, words, version, epoch, keys, target)
    shutil.rmtree(folder)


def write(
    folder: Path, words: str, version: str, epoch: int, keys: Keys, target: Path, squashfs: str = SQUASHFS
) -> None:
    """A bundle of a folder with NAME in it. squashfs: arguments of mksquashfs. Raises ImageError."""
    build = datetime.fromtimestamp(epoch, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    (folder / "manifest.raucm").write_text(_MANIFEST.format(compatible=words, version=version, build=build, name=NAME))
    for path in (*folder.iterdir(), folder):
        os.utime(path, (epoch, epoch))
    target.unlink(missing_ok=True)
    run(
        ["rauc", "bundle", f"--cert={keys.certificate}", f"--key={keys.key}", f"--signing-keyring={keys.keyring}",
         f"--mksquashfs-args={squashfs}", folder, target],
        environment={"SOURCE_DATE_EPOCH": str(epoch)},
    )  # fmt: skip
    if not target.exists():
        raise ImageError(f"{target}: rauc has made none")


def shrunk(slot: Path, target: Path, tools: Path, epoch: int) -> None:
    """A copy without the room that nobody uses: a card writes slowly, and each octet wears it."""
    run(["cp", "--sparse=always", slot, target])
    loader = next(tools.glob("usr/lib/*/ld-linux*.so.*"))
    run(
        [loader, "--library-path", loader.parent, tools / "usr/sbin/resize2fs", "-f", "-M", target],
        environment={"SOURCE_DATE_EPOCH": str(epoch), "E2FSPROGS_FAKE_TIME": str(epoch)},
    )
