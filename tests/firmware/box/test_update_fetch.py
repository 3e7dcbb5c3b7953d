"""Bundles from web servers, broken off and gone on with, and from pipes."""

import errno
import io
import os
from pathlib import Path

import pytest

from board.errors import StationError, StorageError
from firmware.box.update_folder import Folder
from firmware.cli import main
from tests.firmware.box.conftest import Said
from tests.firmware.box.rauc_service import Service
from tests.firmware.box.web_site import FILE, Site, fetch, piped


def test_a_file_is_fetched_whole_and_how_far_it_is_is_told(site: Site, folder: Folder):
    seen: list[tuple[int, int]] = []
    assert fetch(site.url, folder, lambda have, size: seen.append((have, size))) == FILE
    assert seen[-1] == (len(FILE), len(FILE))
    assert not folder.part.exists()


def test_a_connection_that_breaks_off_again_and_again_is_gone_on_with_where_it_was(site: Site, folder: Folder):
    site.does.cuts += [100_000, 50_000, 1, 20_000]
    assert fetch(site.url, folder) == FILE
    assert [wanted for _, wanted in site.does.asked] == [
        None,
        "bytes=100000-",
        "bytes=150000-",
        "bytes=150001-",
        "bytes=170001-",
    ]


def test_a_server_without_ranges_is_begun_with_again(site: Site, folder: Folder):
    site.does.has_ranges = False
    site.does.cuts += [100_000]
    assert fetch(site.url, folder) == FILE


def test_a_file_that_has_changed_meanwhile_is_begun_with_again(site: Site, folder: Folder):
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": site.url, "tag": '"0"', "size": 400_000})
    assert fetch(site.url, folder) == FILE


@pytest.mark.parametrize(("tag", "size"), [('"0"', len(FILE)), ('"1"', 400_000)])
def test_the_rest_of_another_file_is_never_joined_to_a_part(site: Site, folder: Folder, tag: str, size: int):
    site.does.minds_changes = False
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": site.url, "tag": tag, "size": size})
    assert fetch(site.url, folder) == FILE
    assert [wanted for _, wanted in site.does.asked] == ["bytes=3000-", None]


@pytest.mark.parametrize("tag", ['W/"1"', ""])
def test_a_rest_that_is_not_said_to_be_of_another_file_is_taken(site: Site, folder: Folder, tag: str):
    site.does.minds_changes, site.does.tag = False, tag
    folder.part.write_bytes(FILE[:1000])
    folder.note({"url": site.url, "tag": '"1"', "size": len(FILE)})
    site.does.cuts += [1000]
    assert fetch(site.url, folder) == FILE
    assert [wanted for _, wanted in site.does.asked] == ["bytes=1000-", "bytes=2000-"]


@pytest.mark.parametrize("minds_changes", [False, True])
def test_nothing_stays_of_a_file_that_has_changed(site: Site, tmp_path: Path, folder: Folder, minds_changes: bool):
    site.does.minds_changes = minds_changes
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": site.url, "tag": '"0"', "size": len(FILE)})
    with pytest.raises(StationError, match="has room for"):
        fetch(site.url, Folder(tmp_path, reserve=1 << 60))
    assert list(folder.part.parent.iterdir()) == []


def test_another_address_is_begun_with_again(site: Site, folder: Folder):
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": "http://elsewhere/update", "tag": '"1"', "size": 400_000})
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == [("/update", None)]


def test_the_next_run_goes_on_where_this_one_was_broken_off(site: Site, folder: Folder):
    site.does.cuts += [123_456, *[0] * 20]
    with pytest.raises(StationError, match=r"after 123456 of 300000 octets; 0\.1 MB of it had come"):
        fetch(site.url, folder)
    site.does.cuts.clear()
    site.does.asked.clear()
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == [("/update", "bytes=123456-")]


def test_a_run_that_ended_behind_the_last_octet_asks_for_nothing_more(site: Site, folder: Folder):
    folder.part.write_bytes(FILE)
    folder.note({"url": site.url, "tag": '"1"', "size": len(FILE)})
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == []


def test_a_part_that_is_longer_than_the_file_is_begun_with_again(site: Site, folder: Folder):
    folder.part.write_bytes(FILE + b"more")
    folder.note({"url": site.url, "tag": '"1"', "size": 1_000_000})
    assert fetch(site.url, folder) == FILE


def test_a_server_that_does_not_say_how_long_it_is_is_read_to_its_end(site: Site, folder: Folder):
    site.does.has_length = False
    assert fetch(site.url, folder) == FILE


def test_the_rest_in_chunks_is_as_long_as_the_server_has_said(site: Site, folder: Folder):
    folder.part.write_bytes(FILE[:100_000])
    folder.note({"url": site.url, "tag": '"1"', "size": len(FILE)})
    site.does.is_chunked = True
    site.does.protocol_version = "HTTP/1.1"
    site.does.cuts += [50_000]
    assert fetch(site.url, folder) == FILE
    assert [wanted for _, wanted in site.does.asked] == ["bytes=100000-", "bytes=150000-"]


def test_the_room_of_a_part_that_is_begun_with_again_is_room(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": site.url, "tag": '"0"', "size": 400_000})
    monkeypatch.setattr(folder, "room", lambda: 0 if folder.part.exists() else len(FILE))
    assert fetch(site.url, folder) == FILE


@pytest.mark.parametrize("number", [errno.EROFS, errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("name", ["open", "fsync", "rename", "unlink"])
def test_a_card_that_takes_no_writes_is_told(
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


def test_a_pipe_that_cannot_be_read_is_told(folder: Folder):
    class Broken(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            raise OSError(errno.EIO, "Input/output error")

    with pytest.raises(StationError, match="the input cannot be read: Input/output error"):
        piped(Broken(), folder)


def test_an_input_that_is_closed_is_told(service: Service, said: Said, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("sys.stdin", None)  # captain update - <&-
    assert main(["update", "-"]) == 1
    assert said()[1].startswith("captain: the input cannot be read: it is closed\n  (")


def test_a_file_that_has_no_room_is_refused_before_any_of_it_is_written(site: Site, tmp_path: Path):
    folder = Folder(tmp_path, reserve=1 << 60)
    with pytest.raises(StationError, match="has room for 0 MB, and 0 MB are to come"):
        fetch(site.url, folder)
    assert not folder.part.exists()


def test_a_stream_without_an_end_stops_where_the_room_does(folder: Folder, monkeypatch: pytest.MonkeyPatch):
    left = iter([200_000, 100_000, 50_000, 0, 0])
    monkeypatch.setattr(folder, "room", lambda: next(left))
    with pytest.raises(StationError, match="has room for 0 MB"):
        piped(io.BytesIO(bytes(10_000_000)), folder)


def test_a_length_that_no_file_has_is_none(site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(site.does, "length", "9" * 5000)
    assert fetch(site.url, folder) == FILE


def test_what_comes_by_a_pipe_is_taken_to_its_end(folder: Folder):
    folder.part.write_bytes(b"of another one")
    assert piped(io.BytesIO(FILE), folder) == FILE
