"""A card that is larger than its image: the table of partitions grows, whatever is written of it when the power goes."""

import itertools
import struct
import subprocess
from pathlib import Path

import pytest

from image.description import read
from image.filesystem import disk

PROJECT = Path(__file__).resolve().parents[2]
OWN = read(PROJECT / "image/image.toml")
MIB = disk.MIB
INIT = (PROJECT / "image/early/init").read_text()
FUNCTIONS = INIT[INIT.index("u32() {") : INIT.index("disk=${slot")]
# busybox's od gets to a place of a device by reading all before it.
STRICT = 'od() { case "$*" in */*) echo "od: $*" >&2; return 1 ;; esac; command od "$@"; }'


def card(path: Path, size_mib: int) -> Path:
    """The image as it is flashed on a card of this size."""
    with path.open("wb") as file:
        file.truncate(OWN.disk.size_mib * MIB)
    words = ["sfdisk", "-q", "--no-reread", "--no-tell-kernel", path]
    subprocess.run(words, input=disk.table(OWN.disk), text=True, check=True)
    with path.open("r+b") as file:
        file.truncate(size_mib * MIB)
    return path


def grow(path: Path) -> bool:
    sectors = path.stat().st_size // 512
    words = ["sh", "-eu", "-c", f"{STRICT}\n{FUNCTIONS}\nif grow {path} {sectors}; then exit 0; fi; exit 3"]
    ended = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ended.stderr == ""
    assert ended.returncode in (0, 3)
    return ended.returncode == 0


def table(path: Path) -> dict[int, tuple[int, int]]:
    """Begin and end in MiB, as sfdisk reads them; it tells what it does not like."""
    ended = subprocess.run(["sfdisk", "-d", path], capture_output=True, text=True, check=True)
    assert ended.stderr == ""
    found = {}
    for line in ended.stdout.splitlines():
        if "start=" in line:
            name, _, rest = line.partition(" : ")
            start, size = (int(rest.split(f"{word}=")[1].split(",")[0]) * 512 / MIB for word in ("start", "size"))
            found[int(name.removeprefix(str(path)))] = (start, start + size)
    return found


@pytest.mark.parametrize("size_mib", [4096, 30436, 122_000])
def test_the_data_reaches_the_end_of_a_larger_card_and_nothing_else_moves(tmp_path: Path, size_mib: int):
    path = card(tmp_path / "card", size_mib)
    before = table(path)
    assert grow(path)
    after = table(path)
    assert after[6] == (before[6][0], size_mib)
    assert after[4] == (before[4][0], size_mib)
    assert all(after[number] == before[number] for number in (1, 2, 3, 5))
    assert not grow(path)  # once


def test_a_card_of_odd_size_is_used_up_to_a_whole_mebibyte(tmp_path: Path):
    path = card(tmp_path / "card", 4096)
    with path.open("r+b") as file:
        file.truncate(4095 * MIB + 777 * 512)
    assert grow(path)
    assert table(path)[6][1] == 4095


@pytest.mark.parametrize("size_mib", [2048, 2100])
def test_a_card_that_is_hardly_larger_stays_as_it_is(tmp_path: Path, size_mib: int):
    path = card(tmp_path / "card", size_mib)
    before = sectors(path)
    assert not grow(path)
    assert sectors(path) == before


def sectors(path: Path) -> dict[int, bytes]:
    """What may change: the table, and those of the two logical partitions."""
    places = {place.partition.number: place.offset // 512 for place in disk.places(OWN.disk)}
    with path.open("rb") as file:
        found = {}
        for sector in (0, places[5] - 2048, places[6] - 2048):
            file.seek(sector * 512)
            found[sector] = file.read(512)
    return found


def test_wherever_the_power_goes_the_table_is_sound_and_the_next_start_goes_on(tmp_path: Path):
    whole = card(tmp_path / "whole", 4096)
    before = sectors(whole)
    assert grow(whole)
    after = sectors(whole)
    assert all(before[sector] != after[sector] for sector in before)
    for written in range(4):
        path = card(tmp_path / f"cut-{'abcd'[written]}", 4096)
        with path.open("r+b") as file:
            for sector in itertools.islice(after, written):  # in this order
                file.seek(sector * 512)
                file.write(after[sector])
        assert set(table(path)) == {1, 2, 3, 4, 5, 6}
        assert grow(path) == (written < 3)
        assert sectors(path) == after


@pytest.mark.parametrize("damage", ["signature", "link", "behind"])
def test_a_table_that_is_not_the_images_stays_as_it_is(tmp_path: Path, damage: str):
    path = card(tmp_path / "card", 4096)
    outer, inner = list(sectors(path))[1:]
    place, octets = {
        "signature": (inner * 512 + 510, b"\0\0"),
        "link": (outer * 512 + 470, struct.pack("<I", 0)),
        "behind": (inner * 512 + 474, struct.pack("<I", 99)),
    }[damage]
    with path.open("r+b") as file:
        file.seek(place)
        file.write(octets)
    before = sectors(path)
    assert not grow(path)
    assert sectors(path) == before


def test_a_card_that_cannot_be_read_ends_no_start(tmp_path: Path):
    (tmp_path / "card").touch()
    assert not grow(tmp_path / "card")
    words = ["sh", "-eu", "-c", f"{FUNCTIONS}\nif grow {tmp_path}/none ''; then exit 0; fi; exit 3"]
    assert subprocess.run(words, capture_output=True, text=True, check=False).returncode == 3
