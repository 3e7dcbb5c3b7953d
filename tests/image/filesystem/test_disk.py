"""Partitions of the card, and its holes."""

import dataclasses
import itertools
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as some

from image.description import Disk, read
from image.filesystem import disk

OWN = read(Path(__file__).resolve().parents[3] / "image/image.toml").disk


def test_the_own_card_is_laid_out_as_written():
    assert [(place.partition.name, place.start_mib) for place in disk.places(OWN)] == [
        ("boot", 4), ("root-a", 132), ("root-b", 932), ("state", 1733), ("data", 1742),
    ]  # fmt: skip


def test_the_table_names_the_extended_partition_before_the_first_logical_one():
    lines = disk.table(OWN).splitlines()
    assert lines[:3] == ["label: dos", "label-id: 0x43505401", "unit: sectors"]
    assert lines[6] == f"4 : start={1732 * 2048}, size={(2048 - 1732) * 2048}, type=f"
    assert lines[7].startswith(f"5 : start={1733 * 2048}, ")


@given(sizes=some.lists(some.integers(1, 500), min_size=5, max_size=5))
def test_partitions_never_overlap_and_logical_ones_leave_room_for_their_tables(sizes: list[int]):
    parts = tuple(dataclasses.replace(part, size_mib=size) for part, size in zip(OWN.partitions, sizes, strict=True))
    found = disk.places(Disk(1, 4096, parts))
    for place, after in itertools.pairwise(found):
        gap = after.start_mib - place.start_mib - place.partition.size_mib
        assert gap == (1 if after.partition.number >= 5 else 0)


def test_a_card_that_breaks_off_while_it_is_made_leaves_the_one_of_before(tmp_path: Path):
    card, parts = tmp_path / "card.img", tmp_path / "root.ext4"
    card.write_bytes(b"of before")
    with pytest.raises(FileNotFoundError):
        disk.make(OWN, {"root-a": parts}, card)
    assert card.read_bytes() == b"of before"
    parts.write_bytes(b"new")
    disk.make(OWN, {"root-a": parts}, card)
    assert card.stat().st_size == OWN.size_mib * disk.MIB
    assert sorted(path.name for path in tmp_path.iterdir()) == ["card.img", "root.ext4"]


def test_what_is_a_hole_of_a_partition_is_a_hole_of_the_card(tmp_path: Path):
    source, card = tmp_path / "part", tmp_path / "card"
    with source.open("wb") as file:
        file.truncate(16 * disk.MIB)
        file.seek(9 * disk.MIB)
        file.write(b"x" * 5000)
    with card.open("w+b") as file:
        file.truncate(32 * disk.MIB)
        disk._copy(source, file.fileno(), 4 * disk.MIB)
    octets = card.read_bytes()
    assert octets.index(b"x") == 13 * disk.MIB
    assert octets.count(b"x") == 5000
    assert card.stat().st_blocks * 512 < 2 * disk.MIB
