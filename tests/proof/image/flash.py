"""`make flash` at a block device of the kernel's: a loop device, which is a card's but for one word of it."""

import io
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

from image.card import flash
from image.card.flash import BlockDevice, Users
from image.errors import ImageError
from tests.proof.image.bundles import digest_of
from tests.proof.image.rows import Options, Row

CARD_GB = 4
WORDS = ("size", "ro", "dev")  # what the kernel says of a disk, beside removable


def rows(card: Path, folder: Path, options: Options) -> Iterator[Row]:
    medium = folder / "medium"
    with medium.open("wb") as file:
        file.truncate(CARD_GB * 10**9)
    with _looped(medium) as path:
        yield _refused(card, BlockDevice(path), path.name, "is not removable")
        device = BlockDevice(path, _reader(path, folder / "sys"))
        yield _refused(card, device, "sda", "nothing was written")
        began = time.monotonic()
        _write(card, device, path.name)
        took_s = time.monotonic() - began
    is_same = digest_of(medium, 0, card.stat().st_size) == digest_of(card)
    yield Row(
        "written, and read back", f"{took_s:.0f} s, {'the same' if is_same else 'something else'}", "the same", is_same
    )


def _refused(card: Path, device: BlockDevice, answer: str, why: str) -> Row:
    try:
        _write(card, device, answer)
    except ImageError as error:
        return Row(f"{device.path.name}, answered with {answer}", str(error).splitlines()[0], why, why in str(error))
    return Row(f"{device.path.name}, answered with {answer}", "was written", why, False)


def _write(card: Path, device: BlockDevice, answer: str) -> None:
    users = Users(Path("/proc/self/mountinfo").read_text(), Path("/proc/swaps").read_text())
    with redirect_stdout(io.StringIO()):
        flash.write(card, device, users, lambda _: answer)


def _reader(path: Path, folder: Path) -> Path:
    """What the kernel would say of it if it sat in a card reader."""
    about = folder / path.name
    about.mkdir(parents=True)
    for word in WORDS:
        (about / word).write_text((Path("/sys/class/block") / path.name / word).read_text())
    (about / "removable").write_text("1\n")
    return folder


@contextmanager
def _looped(medium: Path) -> Iterator[Path]:
    """As root. Raises subprocess.SubprocessError where the kernel has none."""
    made = subprocess.run(["losetup", "--find", "--show", medium], check=True, capture_output=True, text=True)
    path = made.stdout.strip()
    try:
        yield Path(path)
    finally:
        subprocess.run(["losetup", "--detach", path], check=True)
