"""How much of a bundle is fetched, how slowly, and what stays of it when it breaks off."""

import errno
import io
import itertools
import socket
import threading
from collections.abc import Callable, Iterator

import pytest

from board.errors import StationError
from firmware.box.update_folder import Folder
from firmware.box.update_pace import Pace, TooSlowError
from tests.firmware.box.web_site import FILE, MOST, Site, fetch, piped


def test_what_is_larger_than_any_bundle_is_refused_before_it_is_fetched(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(site.does, "length", str(MOST + 1))
    seen: list[tuple[int, int]] = []
    with pytest.raises(StationError, match="is 20 MB or more, and a bundle for this box has 20 MB at most") as told:
        fetch(site.url, folder, lambda have, size: seen.append((have, size)))
    assert told.value.message.startswith(f"{site.url}: ")
    assert (seen, folder.part.exists()) == ([], False)


@pytest.mark.parametrize("is_chunked", [False, True])
def test_what_has_no_length_is_fetched_up_to_that_of_the_largest_bundle(site: Site, folder: Folder, is_chunked: bool):
    site.does.has_length, site.does.is_chunked = False, is_chunked
    site.does.protocol_version = "HTTP/1.1"
    with pytest.raises(StationError, match=r"is 0 MB or more, and a bundle for this box"):
        fetch(site.url, folder, most=len(FILE) - 1)
    assert list(folder.part.parent.iterdir()) == []
    assert fetch(site.url, folder, most=len(FILE)) == FILE


def test_a_pipe_without_an_end_is_read_up_to_the_length_of_the_largest_bundle(folder: Folder):
    with pytest.raises(StationError, match=r"^the input: is 20 MB or more"):
        piped(io.BytesIO(bytes(MOST + 1)), folder)
    assert list(folder.part.parent.iterdir()) == []
    assert len(piped(io.BytesIO(bytes(MOST)), folder)) == MOST


@pytest.mark.parametrize("error", [OSError(errno.EIO, "Input/output error"), KeyboardInterrupt()])
def test_nothing_stays_of_a_pipe_that_breaks_off(folder: Folder, error: BaseException):
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
def test_a_part_stays_where_its_rest_can_be_asked_for(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, tag: str, has_length: bool, stays: bool
):
    site.does.tag, site.does.has_length = tag, has_length

    def interrupt(have: int, size: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fetch(site.url, folder, interrupt)
    assert folder.part.exists() is stays


@pytest.mark.parametrize(("tag", "words"), [('"1"', "goes on where it was broken off"), ("", "begins anew")])
def test_what_the_next_run_does_with_a_part_is_told(site: Site, folder: Folder, tag: str, words: str):
    site.does.tag = tag
    site.does.cuts += [123_456, *[0 if tag else 1000] * 20]  # without a tag it begins anew each time
    with pytest.raises(StationError) as told:
        fetch(site.url, folder)
    assert words in told.value.hint


def taken(octets: Callable[[int], int], seconds: int) -> Iterator[int]:
    """Each second in which what came was enough; so much comes in a second of that number."""
    now = 0.0
    pace = Pace(lambda: now)
    for second in range(1, seconds + 1):
        now = second
        pace.take(octets(second))
        yield second


def test_a_way_of_2g_is_fast_enough_though_it_is_away_for_half_of_the_time():
    assert len(list(taken(lambda second: 10_000 if second % 300 >= 150 else 0, 7200))) == 7200


def test_what_comes_too_slowly_is_told_after_five_minutes():
    seconds = taken(lambda second: 4000, 400)
    assert [*itertools.islice(seconds, 299)][-1] == 299
    with pytest.raises(TooSlowError, match="1200 kB came within 300 s, and 1500 kB within 300 s are the least"):
        next(seconds)


def test_a_file_that_is_dripped_is_told_as_broken_off_and_gone_on_with_by_the_next_run(site: Site, folder: Folder):
    now = [0.0]

    def seen(have: int, size: int) -> None:
        now[0] += 301

    with pytest.raises(
        StationError, match=r"kB came within 301 s, and .* are the least; 0\.\d MB of it had come"
    ) as told:
        fetch(site.url, folder, seen, lambda: now[0])
    assert "goes on where it was broken off" in told.value.hint
    have = folder.part.stat().st_size
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == [("/update", None), ("/update", f"bytes={have}-")]


def test_a_file_that_comes_in_many_small_connections_is_no_faster(site: Site, folder: Folder):
    now = [0.0]

    def seen(have: int, size: int) -> None:
        now[0] += 30

    site.does.cuts += [1000] * 300
    with pytest.raises(StationError, match="are the least"):
        fetch(site.url, folder, seen, lambda: now[0])
    assert len(site.does.asked) <= 12


def test_headers_that_are_dripped_are_no_answer_either(folder: Folder):
    ticks = itertools.count(0, 301)
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def drip() -> None:
            with listener.accept()[0] as end:
                end.sendall(b"H")
                while end.recv(4096):
                    """Until the box hangs up."""

        dripping = threading.Thread(target=drip)
        dripping.start()
        with pytest.raises(StationError, match="0 kB came within 301 s"):
            fetch(f"http://127.0.0.1:{listener.getsockname()[1]}/x", folder, clock=lambda: next(ticks))
        dripping.join()
