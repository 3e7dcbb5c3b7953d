"""A drive that loses power keeps what was flushed, whatever else it does, and does lose what was not."""

from pathlib import Path
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from tests.proof.image.medium import SECTOR, Fate, Medium

SECTORS = 16
SEED = 7

# What a machine asks of a drive: a write of some sectors (durable by itself or not), zeros, or a flush.
writes = some.tuples(
    some.sampled_from(["write", "durable", "zero"]), some.integers(0, SECTORS - 1), some.integers(1, 6)
)
asked = some.lists(writes | some.just(("flush", 0, 0)), max_size=30)
fates = some.sampled_from(Fate)


def sector(number: int) -> bytes:
    return number.to_bytes(2, "big") * (SECTOR // 2)


def blank(folder: Path, cache: int = 1 << 20) -> Medium:
    path = folder / "medium"
    path.write_bytes(bytes(SECTORS * SECTOR))
    return Medium(path, cache)


def sectors(medium: Medium) -> list[bytes]:
    octets = medium.read(0, SECTORS * SECTOR)
    return [octets[at : at + SECTOR] for at in range(0, len(octets), SECTOR)]


class Promised:
    """Of each sector what it may hold after a cut: what is durable, and everything written since."""

    def __init__(self) -> None:
        self.may: list[list[bytes]] = [[bytes(SECTOR)] for _ in range(SECTORS)]

    def write(self, at: int, octets: bytes, is_durable: bool) -> None:
        self.may[at] = [octets] if is_durable else [*self.may[at], octets]

    def flush(self) -> None:
        self.may = [versions[-1:] for versions in self.may]


def play(medium: Medium, plan: list[tuple[str, int, int]]) -> Promised:
    promised = Promised()
    for number, (what, at, size) in enumerate(plan, 1):
        size_ = min(size, SECTORS - at)
        if what == "flush":
            medium.flush()
            promised.flush()
            continue
        octets = bytes(SECTOR) if what == "zero" else sector(number)
        if what == "zero":
            medium.zero(at * SECTOR, size_ * SECTOR)
        else:
            medium.write(at * SECTOR, octets * size_, what == "durable")
        for place in range(at, at + size_):
            promised.write(place, octets, what == "durable")
    return promised


@settings(max_examples=300, deadline=None)
@given(plan=asked, fate=fates, seed=some.integers(0, 1 << 32))
def test_each_sector_is_what_was_flushed_last_or_something_that_was_written_since(
    tmp_path_factory: pytest.TempPathFactory, plan: list[tuple[str, int, int]], fate: Fate, seed: int
):
    medium = blank(tmp_path_factory.mktemp("medium"))
    promised = play(medium, plan)
    assert sectors(medium) == [versions[-1] for versions in promised.may]  # with power all is as it was written
    medium.cut(fate, Random(seed))
    for found, may in zip(sectors(medium), promised.may, strict=True):
        assert found in may
        assert fate is not Fate.DROP or found == may[0]
        assert fate is not Fate.KEEP or found == may[-1]
    left = sectors(medium)
    medium.cut(Fate.TEAR, Random(seed))
    assert sectors(medium) == left  # the cache is empty: a second cut changes nothing
    medium.close()


def outcomes(folder: Path, fate: Fate, runs: int = 200) -> set[tuple[int, ...]]:
    """Three writes of two sectors each, cut often: which of them each sector is of (0: none)."""
    medium = blank(folder)
    found = set()
    for seed in range(runs):
        medium.zero(0, SECTORS * SECTOR, is_durable=True)
        for number in (1, 2, 3):
            medium.write((number - 1) * 2 * SECTOR, sector(number) * 2)
        medium.cut(fate, Random(seed))
        found.add(tuple(int.from_bytes(octets[:2], "big") for octets in sectors(medium)[:6]))
    medium.close()
    return found


def test_a_drive_that_loses_keeps_nothing_of_its_cache(tmp_path: Path):
    assert outcomes(tmp_path, Fate.DROP) == {(0, 0, 0, 0, 0, 0)}


def test_a_drive_that_reorders_keeps_each_choice_of_whole_writes(tmp_path: Path):
    # The third without the first among them: its cache is no queue.
    found = outcomes(tmp_path, Fate.SHUFFLE)
    assert found == {(a, a, b, b, c, c) for a in (0, 1) for b in (0, 2) for c in (0, 3)}


def test_a_drive_that_tears_keeps_single_sectors_of_a_write(tmp_path: Path):
    found = outcomes(tmp_path, Fate.TEAR)
    assert {row[:2] for row in found} == {(0, 0), (0, 1), (1, 0), (1, 1)}
    assert len(found) > 40  # of 64


def test_of_two_writes_to_a_sector_either_may_be_kept_or_neither(tmp_path: Path):
    medium = blank(tmp_path)
    found = set()
    for seed in range(100):
        medium.zero(0, SECTOR, is_durable=True)
        medium.write(0, sector(1))
        medium.write(0, sector(2))
        medium.cut(Fate.SHUFFLE, Random(seed))
        found.add(sectors(medium)[0])
    assert found == {sector(0), sector(1), sector(2)}
    medium.close()


def test_an_older_write_in_the_cache_never_comes_back_over_a_durable_one(tmp_path: Path):
    medium = blank(tmp_path)
    for seed in range(50):
        medium.write(0, sector(1) * 3)
        medium.write(SECTOR, sector(2), is_durable=True)
        medium.cut(Fate.SHUFFLE, Random(seed))
        assert sectors(medium)[1] == sector(2)
    medium.close()


def test_a_write_that_was_not_answered_may_be_torn_even_where_it_was_to_be_durable(tmp_path: Path):
    medium = blank(tmp_path)
    found = set()
    for seed in range(100):
        medium.zero(0, 2 * SECTOR, is_durable=True)
        medium.cut(Fate.TEAR, Random(seed), (0, sector(9) * 2))
        found.add(tuple(octets == sector(9) for octets in sectors(medium)[:2]))
    assert found == {(False, False), (False, True), (True, False), (True, True)}
    medium.close()


def test_a_full_cache_is_written_down(tmp_path: Path):
    medium = blank(tmp_path, cache=3 * SECTOR)
    medium.write(0, sector(1) * 2)
    medium.write(2 * SECTOR, sector(2) * 2)
    medium.write(4 * SECTOR, sector(3))
    loss = medium.cut(Fate.DROP, Random(SEED))
    assert (loss.pending, loss.gone) == (1, 1)
    assert sectors(medium)[:5] == [sector(1), sector(1), sector(2), sector(2), bytes(SECTOR)]
    medium.close()


def test_a_larger_card_has_zeros_at_its_end(tmp_path: Path):
    medium = blank(tmp_path)
    medium.write(0, sector(1), is_durable=True)
    medium.grow(2 * SECTOR)
    assert medium.size == (SECTORS + 2) * SECTOR
    assert medium.read(SECTORS * SECTOR, 2 * SECTOR) == bytes(2 * SECTOR)
    assert sectors(medium)[0] == sector(1)
    medium.close()


def test_a_loss_counts_what_was_kept_whole_torn_and_gone(tmp_path: Path):
    medium = blank(tmp_path)
    for number in range(8):
        medium.write(2 * number * SECTOR, sector(1) * 2)
    loss = medium.cut(Fate.TEAR, Random(SEED))
    assert loss.pending == 8 == loss.whole + loss.torn + loss.gone
    assert loss.torn
    medium.close()
