"""Bundles from web servers, broken off and gone on with, and from pipes."""

import errno
import io
import os
from pathlib import Path

import pytest

from board.runtime.errors import StationError, StorageError
from firmware.cli import main
from firmware.update.folder import Folder
from tests.firmware.update.conftest import Said
from tests.firmware.update.rauc_service import Service
from tests.firmware.update.web_site import FILE, Site, fetch, piped


def test_file_of_a_server_is_fetched_whole_with_its_progress(site: Site, folder: Folder):
    seen: list[tuple[int, int]] = []
    assert fetch(site.url, folder, lambda have, size: seen.append((have, size))) == FILE
    assert seen[-1] == (len(FILE), len(FILE))
    assert not folder.part.exists()


CHUNKED = {"is_chunked": True, "protocol_version": "HTTP/1.1"}
DATE, OTHER_DATE = "Sun, 06 Nov 1994 08:49:37 GMT", "Mon, 07 Nov 1994 08:49:37 GMT"  # of RFC 9110, clause 5.6.7
BLIND = {"minds_changes": False}
# What the server does; octets, tag and size of the part that is there; the ranges that are asked for.
RESUMED: list[tuple[dict[str, object], tuple[bytes, str, int] | None, list[str | None]]] = [
    # in one run
    ({"cuts": (100_000, 50_000, 1, 20_000)}, None, [None, "bytes=100000-", "bytes=150000-", "bytes=150001-", "bytes=170001-"]),
    ({"cuts": (100_000,), "has_ranges": False}, None, [None, "bytes=100000-"]),
    ({"cuts": (100_000,), "tag": 'W/"1"'}, None, [None, None]),
    ({"cuts": (100_000,), "tag": ""}, None, [None, None]),
    ({"cuts": (100_000,), **CHUNKED}, (FILE[:1000], '"1"', len(FILE)), ["bytes=1000-", "bytes=101000-"]),
    # a part of an earlier run
    ({}, (FILE[:123_456], '"1"', len(FILE)), ["bytes=123456-"]),
    ({}, (FILE, '"1"', len(FILE)), []),
    ({}, (FILE[:1000], "", len(FILE)), [None]),
    ({}, (FILE[:1000], '"1"', 0), [None]),
    ({}, (b"old" * 1000, '"0"', 400_000), ["bytes=3000-"]),
    ({}, (FILE + b"more", '"1"', 1_000_000), ["bytes=300004-", None]),
    # the rest of another file is never joined to it
    (BLIND, (b"old" * 1000, '"0"', len(FILE)), ["bytes=3000-", None]),
    (BLIND, (b"old" * 1000, '"1"', 400_000), ["bytes=3000-", None]),
    (BLIND, (b"old" * 1000, "unquoted", len(FILE)), ["bytes=3000-", None]),
    ({**BLIND, "tag": "", "date": OTHER_DATE}, (b"old" * 1000, DATE, len(FILE)), ["bytes=3000-", None]),
    ({**BLIND, "date": OTHER_DATE}, (b"old" * 1000, DATE, len(FILE)), ["bytes=3000-", None]),
    ({"always_begins": 2000}, (FILE[:1000], '"1"', len(FILE)), ["bytes=1000-", None]),
    # a rest that is not said to be of another file is taken
    ({**BLIND, "tag": 'W/"1"', "cuts": (1000,)}, (FILE[:1000], '"1"', len(FILE)), ["bytes=1000-", "bytes=2000-"]),
    ({**BLIND, "tag": "", "cuts": (1000,)}, (FILE[:1000], '"1"', len(FILE)), ["bytes=1000-", "bytes=2000-"]),
    ({**BLIND, "tag": '"2"'}, (FILE[:1000], DATE, len(FILE)), ["bytes=1000-"]),
    ({**BLIND, "tag": '"2"', "date": DATE}, (FILE[:1000], DATE, len(FILE)), ["bytes=1000-"]),
    ({**BLIND, "date": OTHER_DATE}, (FILE[:1000], '"1"', len(FILE)), ["bytes=1000-"]),
]  # fmt: skip


@pytest.mark.parametrize(("does", "part", "asked"), RESUMED)
def test_file_that_was_broken_off_is_gone_on_with_or_begun_with_again(
    site: Site, folder: Folder, does: dict[str, object], part: tuple[bytes, str, int] | None, asked: list[str | None]
):
    for name, content in does.items():
        setattr(site.does, name, [*content] if isinstance(content, tuple) else content)
    if part:
        octets, tag, size = part
        folder.part.write_bytes(octets)
        folder.note({"url": site.url, "tag": tag, "size": size})
    if "always_begins" in does:  # the second answer is one, too
        with pytest.raises(StationError):
            fetch(site.url, folder)
    else:
        assert fetch(site.url, folder) == FILE
    assert [wanted for _, wanted in site.does.asked] == asked


def test_part_of_another_address_is_begun_with_again(site: Site, folder: Folder):
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": "http://elsewhere/update", "tag": '"1"', "size": 400_000})
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == [("/update", None)]


@pytest.mark.parametrize("minds_changes", [False, True])
def test_part_of_a_file_that_has_changed_does_not_stay(site: Site, tmp_path: Path, folder: Folder, minds_changes: bool):
    site.does.minds_changes = minds_changes
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": site.url, "tag": '"0"', "size": len(FILE)})
    with pytest.raises(StationError):
        fetch(site.url, Folder(tmp_path, reserve=1 << 60))
    assert list(folder.part.parent.iterdir()) == []


def test_next_run_goes_on_where_one_was_broken_off(site: Site, folder: Folder):
    site.does.cuts += [123_456, *[0] * 20]
    with pytest.raises(StationError, match=r"123456 of 300000 octets; 0\.1 MB"):
        fetch(site.url, folder)
    site.does.cuts.clear()
    site.does.asked.clear()
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == [("/update", "bytes=123456-")]


def test_room_of_a_part_that_is_begun_with_again_is_room(site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch):
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": site.url, "tag": '"0"', "size": 400_000})
    monkeypatch.setattr(folder, "room", lambda: 0 if folder.part.exists() else len(FILE))
    assert fetch(site.url, folder) == FILE


@pytest.mark.parametrize("number", [errno.EROFS, errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("name", ["open", "fsync", "rename", "unlink"])
def test_card_that_takes_no_writes_is_told(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, name: str, number: int
):
    def refuse(*arguments: object, **named: object) -> None:
        raise OSError(number, words)

    words = os.strerror(number)
    if name == "fsync":
        monkeypatch.setattr("os.fsync", refuse)
    else:
        monkeypatch.setattr(Path, name, refuse)
    with pytest.raises(StorageError, match=words):
        fetch(site.url, folder)
    with pytest.raises(StorageError, match=words):
        piped(io.BytesIO(FILE), folder)


def test_pipe_that_cannot_be_read_is_told(folder: Folder):
    class Broken(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            raise OSError(errno.EIO, "Input/output error")

    with pytest.raises(StationError, match=r"^standard input: cannot be read: Input/output error"):
        piped(Broken(), folder)


def test_input_that_is_closed_is_told(service: Service, said: Said, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("sys.stdin", None)  # captain update - <&-
    assert main(["update", "-"]) == 1
    assert said()[1].startswith("captain: standard input: ")


def test_file_without_room_is_refused_before_it_is_written(site: Site, tmp_path: Path):
    folder = Folder(tmp_path, reserve=1 << 60)
    with pytest.raises(StationError, match=f"^{folder.place}: no room"):
        fetch(site.url, folder)
    assert not folder.part.exists()


def test_stream_without_an_end_stops_where_the_room_does(folder: Folder, monkeypatch: pytest.MonkeyPatch):
    left = iter([200_000, 100_000, 50_000, 0, 0])
    monkeypatch.setattr(folder, "room", lambda: next(left))
    with pytest.raises(StationError, match=f"^{folder.place}: no room"):
        piped(io.BytesIO(bytes(10_000_000)), folder)


def test_pipe_is_taken_to_its_end(folder: Folder):
    folder.part.write_bytes(b"of another one")
    assert piped(io.BytesIO(FILE), folder) == FILE
