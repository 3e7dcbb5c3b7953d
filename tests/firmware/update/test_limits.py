"""Limits of a bundle's download, and its rest after an interruption."""

import errno
import io
import itertools
import socket
import threading
from collections.abc import Callable, Iterator

import pytest

from board.runtime.errors import StationError
from firmware.update.fetch import AGAIN, ANEW
from firmware.update.folder import Folder
from firmware.update.pace import Pace, TooSlowError
from tests.firmware.update.web_site import FILE, MOST, Site, fetch, piped


def test_file_larger_than_any_bundle_is_refused_before_it_is_fetched(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(site.does, "length", str(MOST + 1))
    seen: list[tuple[int, int]] = []
    with pytest.raises(StationError, match="20 MB") as told:
        fetch(site.url, folder, lambda have, size: seen.append((have, size)))
    assert told.value.message.startswith(f"{site.url}: ")
    assert (seen, folder.part.exists()) == ([], False)


@pytest.mark.parametrize("is_chunked", [False, True])
def test_file_without_a_length_is_fetched_up_to_the_largest_bundle(site: Site, folder: Folder, is_chunked: bool):
    site.does.has_length, site.does.is_chunked = False, is_chunked
    site.does.protocol_version = "HTTP/1.1"
    with pytest.raises(StationError, match=" 0 MB "):
        fetch(site.url, folder, most=len(FILE) - 1)
    assert list(folder.part.parent.iterdir()) == []
    assert fetch(site.url, folder, most=len(FILE)) == FILE


def test_pipe_without_an_end_is_read_up_to_the_largest_bundle(folder: Folder):
    with pytest.raises(StationError, match=r"^standard input: .*20 MB"):
        piped(io.BytesIO(bytes(MOST + 1)), folder)
    assert list(folder.part.parent.iterdir()) == []
    assert len(piped(io.BytesIO(bytes(MOST)), folder)) == MOST


@pytest.mark.parametrize("error", [OSError(errno.EIO, "Input/output error"), KeyboardInterrupt()])
def test_pipe_that_breaks_off_leaves_nothing(folder: Folder, error: BaseException):
    class Broken(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            if self.tell():
                raise error
            return super().read(size)

    with pytest.raises((StationError, KeyboardInterrupt)):
        piped(Broken(FILE), folder)
    assert list(folder.part.parent.iterdir()) == []


@pytest.mark.parametrize(
    ("tag", "has_length", "stays"),
    [('"1"', True, True), ('"1"', False, False), ("", True, False), ('W/"1"', True, False)],
)
def test_part_stays_where_its_rest_can_be_asked_for(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, tag: str, has_length: bool, stays: bool
):
    site.does.tag, site.does.has_length = tag, has_length

    def interrupt(have: int, size: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fetch(site.url, folder, interrupt)
    assert folder.part.exists() is stays


@pytest.mark.parametrize(("tag", "words"), [('"1"', AGAIN), ("", ANEW)])
def test_part_that_stays_is_told_with_what_the_next_run_does(site: Site, folder: Folder, tag: str, words: str):
    site.does.tag = tag
    site.does.cuts += [123_456, *[0 if tag else 1000] * 20]  # without a tag it begins anew each time
    with pytest.raises(StationError) as told:
        fetch(site.url, folder)
    assert told.value.hint == words


def taken(octets: Callable[[int], int], seconds: int) -> Iterator[int]:
    """Each second in which what came was enough; so much comes in a second of that number."""
    now = 0.0
    pace = Pace(lambda: now)
    for second in range(1, seconds + 1):
        now = second
        pace.take(octets(second))
        yield second


def test_pace_of_2g_that_is_away_half_of_the_time_is_enough():
    assert len(list(taken(lambda second: 10_000 if second % 300 >= 150 else 0, 7200))) == 7200


def test_pace_that_is_too_slow_is_told_after_five_minutes():
    seconds = taken(lambda second: 4000, 400)
    assert [*itertools.islice(seconds, 299)][-1] == 299
    with pytest.raises(TooSlowError, match=r"1200 kB .*300 s.*1500 kB"):
        next(seconds)


def test_file_that_is_dripped_is_broken_off_and_gone_on_with_by_the_next_run(site: Site, folder: Folder):
    now = [0.0]

    def seen(have: int, size: int) -> None:
        now[0] += 301

    with pytest.raises(StationError, match=r" 301 s.*; 0\.\d MB") as told:
        fetch(site.url, folder, seen, lambda: now[0])
    assert told.value.hint == AGAIN
    have = folder.part.stat().st_size
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == [("/update", None), ("/update", f"bytes={have}-")]


def test_file_in_many_small_connections_is_too_slow_as_well(site: Site, folder: Folder):
    now = [0.0]

    def seen(have: int, size: int) -> None:
        now[0] += 30

    site.does.cuts += [1000] * 300
    with pytest.raises(StationError, match="1500 kB"):
        fetch(site.url, folder, seen, lambda: now[0])
    assert len(site.does.asked) <= 12


def test_headers_that_are_dripped_are_too_slow_as_well(folder: Folder):
    ticks = itertools.count(0, 301)
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def drip() -> None:
            with listener.accept()[0] as end:
                end.sendall(b"H")
                while end.recv(4096):
                    """Until the box hangs up."""

        dripping = threading.Thread(target=drip)
        dripping.start()
        with pytest.raises(StationError, match=r"0 kB .*301 s"):
            fetch(f"http://127.0.0.1:{listener.getsockname()[1]}/x", folder, clock=lambda: next(ticks))
        dripping.join()
