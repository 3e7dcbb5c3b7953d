"""Findings on a card that differs from its description.

Whole cards: python -m tests.proof.image, .ci/image verify.
"""

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from board.runtime import boot_counters
from image.description import read
from image.errors import ImageError
from image.filesystem import disk
from image.verify.card import Check, FinishedCard
from tests.said import of_key

OWN = read(Path(__file__).resolve().parents[3] / "image/image.toml")
MIB = disk.MIB


def entry(start: int, sectors: int, kind: int) -> bytes:
    """A row of a table of partitions, in sectors. Source: the PC's master boot record; CHS is not looked at."""
    return struct.pack("<B3sB3sII", 0, b"", kind, b"", start, sectors)


def card(path: Path, change: Callable[[bytearray], None] = lambda head: None) -> Path:
    """A card with its tables and its counters, by hand."""
    at = {place.partition.number: place for place in disk.places(OWN.disk)}
    first = at[5].offset - MIB
    rows = [entry(at[n].offset // 512, at[n].partition.size_mib * MIB // 512, 0x83) for n in (1, 2, 3)]
    head = bytearray(512)
    head[440:444] = OWN.disk.label_id.to_bytes(4, "little")
    head[446:510] = b"".join([*rows, entry(first // 512, (2048 * MIB - first) // 512, 0x0F)])
    head[510:] = b"\x55\xaa"
    change(head)
    with path.open("wb") as file:
        file.truncate(OWN.disk.size_mib * MIB)
        file.write(head)
        for number in (5, 6):
            file.seek(at[number].offset - MIB + 446)
            file.write(entry(MIB // 512, at[number].partition.size_mib * MIB // 512, 0x83))
        file.seek(at[5].offset)
        file.write(boot_counters.blank())
    return path


def trouble(path: Path) -> dict[str, str]:
    looked = FinishedCard(OWN, path, Path("/none"))
    return {row.check: row.trouble for row in (looked._table(), looked._counters())}


def test_card_as_described_passes(tmp_path: Path):
    assert list(trouble(card(tmp_path / "card")).values()) == ["", ""]


def other_label(head: bytearray) -> None:
    head[440] ^= 1


def moved_slot(head: bytearray) -> None:
    head[446 + 16 + 8] ^= 8


def smaller_slot(head: bytearray) -> None:
    head[446 + 32 + 13] ^= 1


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (other_label, "its id is 0x43505400, not 0x43505401"),
        (moved_slot, "root-a lies at sector 270344"),
        (smaller_slot, "root-b lies at sector"),
    ],
)
def test_table_of_partitions_that_differs_fails_with_the_difference(
    tmp_path: Path, change: Callable[[bytearray], None], said: str
):
    assert said in of_key(trouble(card(tmp_path / "card", change)), "partitions")


def test_a_card_that_was_cut_short_is_told(tmp_path: Path):
    path = card(tmp_path / "card")
    with path.open("r+b") as file:
        file.truncate(100 * MIB)
    assert [row.trouble for row in FinishedCard(OWN, path, built(tmp_path / "built")).rows()] == [
        f"the image has {100 * MIB} octets, not 2048 MiB"
    ]


def test_a_card_that_was_never_built_is_told_with_what_builds_it(tmp_path: Path):
    for path in (tmp_path / "card", card(tmp_path / "one")):  # without its tools a card cannot be looked at either
        with pytest.raises(ImageError, match=r"(?s)is not there.*make image builds it"):
            list(FinishedCard(OWN, path, tmp_path / "built").rows())


def built(folder: Path) -> Path:
    """As much of a build's folder as is asked for before anything is looked at."""
    for name in ("tools", "kernel/tree", "early"):
        (folder / name).mkdir(parents=True)
    (folder / "early/initrd").touch()
    return folder


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            ImageError("mcopy -i card: ended with 1:\ninit :: non DOS media\nCannot initialize '::'"),
            "init :: non DOS media; Cannot initialize '::'",
        ),
        (ValueError("bad marshal data"), "a file in it is damaged: ValueError('bad marshal data')"),
    ],
)
def test_part_that_cannot_be_read_fails_and_the_others_are_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception, said: str
):
    first = Check("the first of it")

    def damaged(self: FinishedCard) -> Iterator[Check]:
        yield first
        raise error

    def sound(self: FinishedCard, known_keys: bytes = b"") -> Iterator[Check]:
        yield Check("what is sound")

    def nothing(self: FinishedCard) -> Check:
        return Check("nothing")

    for name in ("_boot_partition", "_slot"):
        monkeypatch.setattr(FinishedCard, name, damaged)
    for name in ("_data", "_unwanted_words"):
        monkeypatch.setattr(FinishedCard, name, sound)
    monkeypatch.setattr(FinishedCard, "_same_slots", nothing)
    monkeypatch.setattr(FinishedCard, "_known_keys", lambda card: b"")
    rows = list(FinishedCard(OWN, card(tmp_path / "card"), built(tmp_path / "built")).rows())
    assert rows[-6:] == [
        first,
        Check("the boot partition can be read", said),
        first,
        Check("the slot can be read", said),
        Check("what is sound"),
        Check("what is sound"),
    ]


USED = boot_counters.packed(boot_counters.State(("B", "A"), 3, 2), 2)


@pytest.mark.parametrize(
    ("at", "octets", "said"),
    [
        (0, USED, "copy 1 is (State(order=('B', 'A'), a_left=3, b_left=2, new='0', again='0'), 2) and not (State("),
        (
            boot_counters.APART,
            USED,
            "copy 2 is (State(order=('B', 'A'), a_left=3, b_left=2, new='0', again='0'), 2) and not",
        ),
        (
            0,
            boot_counters.packed(boot_counters.State(), 9),
            "copy 1 is (State(order=('A', 'B'), a_left=3, b_left=3, new='0', again='0'), 9)",
        ),
        (0, bytes(boot_counters.SIZE), "copy 1 is None and not"),
        (boot_counters.APART, b"x", "copy 2 is None and not"),
        (boot_counters.SIZE, b"x", "there is something beside both copies"),
        (8 * MIB - 1, b"x", "there is something beside both copies"),
    ],
)
def test_counters_that_are_not_as_they_were_made_are_told(tmp_path: Path, at: int, octets: bytes, said: str):
    path = card(tmp_path / "card")
    offset = next(place.offset for place in disk.places(OWN.disk) if place.partition.name == "state")
    with path.open("r+b") as file:
        file.seek(offset + at)
        file.write(octets)
    assert trouble(path)["the boot counters"].startswith(said)
