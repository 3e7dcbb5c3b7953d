"""Flashing: question, write, read back; a file is the card."""

import errno
import hashlib
import io
import os
from pathlib import Path
from random import Random
from typing import BinaryIO

import pytest

from image.card import flash
from image.card.flash import BlockDevice, Users
from image.errors import ImageError
from tests.said import tells

MIB = 1 << 20
NOBODY = Users(
    "24 1 8:1 / / rw - ext4 /dev/sda1 rw\n", "Filename Type Size Used Priority\n/dev/sda2 partition 1 0 -2\n"
)


def device(tmp_path: Path, name: str = "sdx", /, **words: str) -> BlockDevice:
    """sdx1__dev="8:17" is the file sdx1/dev; the device itself is a file beside."""
    folder = tmp_path / "sys" / name
    for key, value in {"size": "8388608", "removable": "1", "dev": "8:16", **words}.items():
        path = folder / key.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(value + "\n")
    return BlockDevice(tmp_path / name, tmp_path / "sys")


@pytest.fixture
def image(tmp_path: Path) -> Path:
    path = tmp_path / "image"
    path.write_bytes(Random(1).randbytes(5 * MIB) + bytes(3 * MIB) + b"end")
    return path


def written(image: Path, card: BlockDevice, answer: str) -> list[str]:
    """What was asked."""
    asked: list[str] = []

    def ask(question: str) -> str:
        asked.append(question)
        return answer

    flash.write(image, card, NOBODY, ask)
    return asked


def test_a_card_in_a_reader_is_taken(tmp_path: Path):
    device(tmp_path).refuse(2 << 30, NOBODY)
    device(tmp_path, "mmcblk0", removable="0", device__type="SD").refuse(2 << 30, NOBODY)


@pytest.mark.parametrize(
    ("words", "users", "said"),
    [
        ({"partition": "1"}, NOBODY, "is a partition"),
        ({"size": "2048"}, NOBODY, "has 1 MiB, and the image 2048"),
        ({"ro": "1"}, NOBODY, "may only be read"),
        ({"removable": "0", "device__model": "Fast SSD"}, NOBODY, "Fast SSD is not removable"),
        ({"removable": "0", "device__type": "MMC"}, NOBODY, "this disk is not removable"),
        ({"size": str(1 << 31)}, NOBODY, "has 1024 GiB, which no card of a box has"),
        ({}, Users("24 1 8:16 / /media/card rw - vfat /dev/sdx rw"), "is in use: mounted at /media/card"),
        # The kernel's name for what it has booted from.
        ({"sdx1__partition": "1", "sdx1__dev": "8:17"}, Users("24 1 8:17 / / rw - ext4 /dev/root rw"), "mounted at /"),
        ({"sdx2__partition": "2"}, Users("24 1 0:30 / /home rw - btrfs /dev/sdx2 rw"), "mounted at /home"),
        ({"sdx3__partition": "3"}, Users("", "/dev/sdx3 partition 1 0 -2"), "/dev/sdx3 is swap"),
        ({"sdx1__partition": "1", "sdx1__holders__dm-0": ""}, NOBODY, "is in use: part of dm-0"),
    ],
)
def test_what_may_be_a_computers_own_disk_is_refused(tmp_path: Path, words: dict[str, str], users: Users, said: str):
    with pytest.raises(ImageError, match=said):
        device(tmp_path, **words).refuse(2 << 30, users)


def test_what_is_no_device_is_refused(tmp_path: Path):
    with pytest.raises(ImageError, match="not a block device"):
        BlockDevice(Path("/dev/none"), tmp_path).refuse(1, NOBODY)


def test_card_is_written_whole_after_a_question_with_its_name(
    tmp_path: Path, image: Path, capsys: pytest.CaptureFixture[str]
):
    card = device(tmp_path, device__vendor="Generic", device__model="Reader")
    card.path.write_bytes(b"old" * 4 * MIB)
    (question,) = written(image, card, "sdx")
    assert "Type sdx" in question
    octets = card.path.read_bytes()
    assert octets[: image.stat().st_size] == image.read_bytes()
    assert octets[image.stat().st_size :] == (b"old" * 4 * MIB)[image.stat().st_size :]
    said = capsys.readouterr().out
    assert tells(said.splitlines()[0], f"{card.path} (Generic Reader, 4.3 GB)", "lost")
    assert "100 %" in said
    assert "written, and read back" in said


@pytest.mark.parametrize("answer", ["", "y", "yes", "sdy", "/dev/sdx"])
def test_another_answer_than_its_name_writes_nothing(tmp_path: Path, image: Path, answer: str):
    card = device(tmp_path)
    card.path.write_bytes(b"old")
    with pytest.raises(ImageError, match="nothing was written"):
        written(image, card, answer)
    assert card.path.read_bytes() == b"old"


class Worn(BlockDevice):
    """Loses an octet between writing and reading."""

    def opened(self, flags: int) -> BinaryIO:
        if not flags & os.O_RDWR:
            with self.path.open("r+b") as file:
                file.seek(6 * MIB)
                file.write(b"x")
        return super().opened(flags)


def test_a_card_that_reads_back_something_else_is_told(tmp_path: Path, image: Path):
    card = Worn(device(tmp_path).path, tmp_path / "sys")
    card.path.write_bytes(b"")
    with pytest.raises(ImageError, match=f"the octets before {8 * MIB} differ from those written\n.*worn out"):
        written(image, card, "sdx")


def test_a_card_that_holds_less_than_it_says_is_told(tmp_path: Path, image: Path):
    class Short(BlockDevice):
        def opened(self, flags: int) -> BinaryIO:
            if not flags & os.O_RDWR:
                os.truncate(self.path, MIB)
            return super().opened(flags)

    card = Short(device(tmp_path).path, tmp_path / "sys")
    card.path.write_bytes(b"")
    with pytest.raises(ImageError, match="differ from those written"):
        written(image, card, "sdx")


def test_a_device_that_cannot_be_opened_is_told(tmp_path: Path, image: Path):
    with pytest.raises(ImageError, match="sdx: cannot be opened: No such file or directory"):
        written(image, device(tmp_path), "sdx")


def test_a_card_that_is_pulled_out_is_told(tmp_path: Path, image: Path):
    class Pulled(BlockDevice):
        def opened(self, flags: int) -> BinaryIO:
            class File(io.FileIO):
                def write(self, octets: object) -> int:
                    raise OSError(errno.EIO, "Input/output error")

            return File(self.path, "r+")  # type: ignore[return-value]

    card = Pulled(device(tmp_path).path, tmp_path / "sys")
    card.path.write_bytes(b"")
    with pytest.raises(ImageError, match=r"sdx: Input/output error"):
        written(image, card, "sdx")


@pytest.mark.parametrize("answer", [EOFError, KeyboardInterrupt])
def test_no_answer_writes_nothing(tmp_path: Path, image: Path, answer: type[BaseException]):
    def ask(question: str) -> str:
        raise answer

    with pytest.raises(ImageError, match="nothing was written"):
        flash.write(image, device(tmp_path), NOBODY, ask)


def test_an_image_is_one_that_was_built_to_its_end(tmp_path: Path, image: Path):
    sums = tmp_path / "image.sha256"
    with pytest.raises(ImageError, match="the build of this image was not completed"):
        flash.compare(image, sums)
    sums.write_bytes(b"\xff\xfe rubbish\n")
    with pytest.raises(ImageError, match="the build of this image was not completed"):
        flash.compare(image, sums)
    sums.write_text(f"{'0' * 64}  image.raucb\n{hashlib.sha256(image.read_bytes()).hexdigest()}  image\n")
    flash.compare(image, sums)
    with image.open("r+b") as file:
        file.write(b"x")
    with pytest.raises(ImageError, match="has changed since it was built"):
        flash.compare(image, sums)


def test_a_file_is_no_card_and_nobody_is_asked_without_a_terminal(
    tmp_path: Path, image: Path, monkeypatch: pytest.MonkeyPatch
):
    sums = tmp_path / "image.sha256"
    sums.write_text(f"{hashlib.sha256(image.read_bytes()).hexdigest()}  image\n")
    with pytest.raises(ImageError, match="standard input is not a terminal"):
        flash.flash(image, sums, tmp_path / "sdx")
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    with pytest.raises(ImageError, match="not a block device"):
        flash.flash(image, sums, image)
    with pytest.raises(ImageError, match=r"none: is not there\n.*make image"):
        flash.flash(tmp_path / "none", sums, tmp_path / "sdx")


def test_card_whose_writing_is_stopped_is_reported_as_incomplete(
    tmp_path: Path, image: Path, monkeypatch: pytest.MonkeyPatch
):
    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    card = device(tmp_path)
    card.path.write_bytes(b"old")
    monkeypatch.setattr(flash, "_all_written", stopped)
    with pytest.raises(ImageError, match=r"sdx: stopped before it was written") as told:
        written(image, card, "sdx")
    assert "incomplete" in str(told.value)
