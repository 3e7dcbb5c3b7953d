"""Shares of kept files: which file goes, beside a second way to find it, and what a step costs."""

from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware.recorder.shares import OF_EVENT, Key, Shares, key_of

LIMIT = 1000
WORDS = ["denm-1", "denm-2", "denm-3", "denm-own", "loss", "gnss", "near-miss"]
EVENTS = st.lists(st.lists(st.tuples(st.sampled_from(WORDS), st.integers(1, 300)), max_size=5), max_size=12)


class Folder:
    """Files of a ring, kept one after the other; number of the last."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.number = 0

    def keep(self, shares: Shares, word: str, size: int) -> str:
        """The name of the file that is kept; empty where it has no room."""
        self.number += 1
        path = self.path / f"ring-{self.number:08d}-20260101T000000Z.pcapng"
        path.write_bytes(bytes(size))
        if not shares.is_room(size, key_of(word)):
            path.unlink()
            return ""
        shares.keep(path, size, word)
        return path.name.replace("ring", "kept").replace(".", f"-{word}.")

    def kept(self) -> dict[str, int]:
        return {path.name: path.stat().st_size for path in self.path.iterdir()}


def key_in(name: str) -> Key:
    return key_of(name.split("-", 3)[3].removesuffix(".pcapng"))


def left(files: dict[str, int], event: set[str], size: int, key: Key) -> dict[str, int] | None:
    """What is left of files (octets by name) once there is room, by going through all of them; None for no room."""
    files = dict(files)
    while sum(files.values()) + size > LIMIT:
        if sum(files[name] for name in event) + size > LIMIT // OF_EVENT:
            return None
        causes, keys = Counter[str](), Counter[Key]()
        for name in files.keys() - event:
            causes[key_in(name).cause] += files[name]
            keys[key_in(name)] += files[name]
        octets, cause = max(((causes[one], one) for one in causes), default=(0, key.cause))
        if octets <= causes[key.cause]:
            cause = key.cause
        largest = max((keys[one] for one in keys if one.cause == cause), default=None)
        may_go = [
            name for name in files.keys() - event if key_in(name).cause == cause and keys[key_in(name)] == largest
        ]
        if not may_go:
            return None
        del files[min(may_go)]
    return files


@given(EVENTS)
def test_the_files_that_go_are_the_oldest_of_the_largest_share(events: list[list[tuple[str, int]]]) -> None:
    with TemporaryDirectory() as name:
        folder, shares = Folder(Path(name)), Shares(LIMIT)
        for event in events:
            shares.look(folder.path)
            mine: set[str] = set()
            for word, size in event:
                before = folder.kept()
                kept = folder.keep(shares, word, size)
                assert shares.size == sum(folder.kept().values()) <= LIMIT
                wanted = left(before, mine, size, key_of(word))
                assert bool(kept) == (wanted is not None)
                if wanted is not None:
                    assert folder.kept() == wanted | {kept: size}
                    mine.add(kept)
                for one in WORDS:
                    octets = sum(size for name, size in folder.kept().items() if key_in(name) == key_of(one))
                    assert shares.taken(key_of(one)) == octets


def test_an_event_looks_at_no_file_that_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, shares = Folder(tmp_path), Shares(LIMIT)
    names = [folder.keep(shares, word, 10) for word in WORDS]
    looked: list[str] = []
    stat = Path.stat
    monkeypatch.setattr(Path, "stat", lambda path, **how: (looked.append(path.name), stat(path, **how))[1])
    shares.look(tmp_path)
    assert looked == []
    other = Shares(LIMIT)
    other.look(tmp_path)
    other.look(tmp_path)
    assert sorted(looked) == sorted(names)


def test_a_file_that_an_operator_removed_or_added_is_known_by_the_next_event(tmp_path: Path) -> None:
    folder, shares = Folder(tmp_path), Shares(LIMIT)
    first, _ = folder.keep(shares, "denm-1", 100), folder.keep(shares, "denm-2", 50)
    (tmp_path / first).rename(tmp_path / first.replace("denm-1", "loss"))
    shares.look(tmp_path)
    assert [shares.taken(key_of(word)) for word in ("denm-1", "denm-2", "loss")] == [0, 50, 100]
    assert shares.size == 150
