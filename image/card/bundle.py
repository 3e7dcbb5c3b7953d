"""Update bundle: a slot's file system, signed: build/captain-VERSION-ARCHITECTURE.raucb.

The same slot gives the same contents. Only the salt of the hash tree, the time of signing and the signature differ.
"""

import os
import shutil
from datetime import UTC, datetime
from pathlib import Path

from image.card.keys import Keys
from image.errors import ImageError
from image.tool import run

# The verity format verifies each block while it is installed. The older format would not detect a change of the file
# between check and installation.
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
# Level 15 with blocks of 256 KiB is 2 % smaller than level 8 with blocks of 1 MiB, but takes nine times as long.
SQUASHFS = "-comp zstd -Xcompression-level 8 -b 1M"


def make(slot: Path, words: str, version: str, epoch: int, keys: Keys, tools: Path, target: Path) -> None:
    """Make the update bundle of a slot's file system.

    words  compatibility string, which a box compares with its own: Description.compatible.
    epoch  date of the build and of all files in the bundle, Unix seconds.
    tools  folder of an unpacked e2fsprogs.

    Raises ImageError if a tool fails.
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
    """Write a bundle of a folder that contains NAME. squashfs: arguments of mksquashfs.

    Raises ImageError if rauc makes no bundle.
    """
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
    """Copy a file system without its free room, because a card writes slowly and wears with each octet."""
    run(["cp", "--sparse=always", slot, target])
    loader = next(tools.glob("usr/lib/*/ld-linux*.so.*"))
    run(
        [loader, "--library-path", loader.parent, tools / "usr/sbin/resize2fs", "-f", "-M", target],
        environment={"SOURCE_DATE_EPOCH": str(epoch), "E2FSPROGS_FAKE_TIME": str(epoch)},
    )
