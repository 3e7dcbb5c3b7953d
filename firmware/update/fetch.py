"""Fetches a bundle from a URL or pipe; resumes interrupted downloads."""

import http.client
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from board.runtime.errors import StationError, StorageError
from firmware.update import server
from firmware.update.folder import Folder, storing
from firmware.update.pace import Pace, TooSlowError
from firmware.update.server import BrokenOffError, ChangedError, Part
from firmware.update.trouble import NOBODY, Trouble, trouble

CHUNK = 1 << 16  # octets
PAUSES_S = (1.0, 2.0, 4.0, 8.0, 15.0)  # pauses between tries that bring nothing, after the first octets were received
NAME_ONE = "name a bundle, captain-VERSION-arm64.raucb"
INPUT = "standard input"
ANEW = "captain update with the same address starts again: this server cannot resume"
AGAIN = "captain update with the same address resumes"

Seen = Callable[[int, int], None]  # called with the octets received so far, and the total, or 0 if unknown


def is_url(source: str) -> bool:
    return source.lower().startswith(("http://", "https://"))


def from_stream(stream: BinaryIO, folder: Folder, seen: Seen, most: int) -> Path:
    """Store a stream until its end; return the path of the bundle.

    most  largest accepted size in octets.

    Raises StationError if the stream cannot be read, does not fit on the data partition or exceeds `most`. Raises
    StorageError if the card refuses writes.
    """

    def broken(error: Exception) -> Exception:
        why = getattr(error, "strerror", None) or str(error)
        return StationError(f"{INPUT}: cannot be read: {why}", "send the bundle again")

    folder.clear()
    with _kept(folder):
        _store(_chunks(stream.read, broken), INPUT, folder, seen, most)
    return folder.finish()


def from_url(
    url: str,
    folder: Folder,
    seen: Seen,
    most: int,
    sleep: Callable[[float], None] = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> Path:
    """Download a file; return its path. A part that can be resumed is kept for the next call.

    most   largest accepted size in octets.
    sleep  waits between two tries, in seconds.

    Raises StationError if the file cannot be fetched, does not fit on the data partition or exceeds `most`. Raises
    StorageError if the card refuses writes.
    """
    if folder.about().get("url") != url:
        folder.clear()
    first = before = _part(folder).octets
    tries, pace = 0, Pace(clock)
    with _kept(folder):
        while True:
            try:
                _fetch(url, folder, seen, most, pace)
                return folder.finish()
            except TooSlowError as slow:
                raise _ended(url, Trouble(f"{slow}", NOBODY), folder) from slow
            except BrokenOffError as broken:
                have = _part(folder).octets
                tries = 0 if have > before else tries + 1
                if have == first or tries >= len(PAUSES_S):
                    raise _ended(url, broken.trouble, folder) from broken
                before = have
            sleep(PAUSES_S[tries])


def _ended(url: str, why: Trouble, folder: Folder) -> StationError:
    """Return the StationError for a download that ended without success."""
    part = _part(folder)
    if not part.octets:
        return StationError(f"{url}: {why.words}", why.hint)
    return StationError(
        f"{url}: {why.words}; {part.octets / 1e6:.1f} MB were received", AGAIN if part.has_rest else ANEW
    )


def _fetch(url: str, folder: Folder, seen: Seen, most: int, pace: Pace) -> None:
    """Fetch the missing rest in one connection. Raises StationError, BrokenOffError or TooSlowError on failure."""
    part = _part(folder)
    if part.octets and part.octets == part.size:
        return  # the previous connection ended after the last octet
    try:
        answer = server.asked(url, part, pace)
    except ChangedError:
        folder.clear()
        answer = server.asked(url, Part(), pace)
    with answer.response:
        _check_size(most, answer.total, url, folder)
        if answer.begin == 0:
            folder.clear()  # frees the room of the old part before need()
        folder.need(max(0, answer.total - answer.begin))
        folder.note({"url": url, "tag": answer.tag, "size": answer.total})
        chunks = _chunks(answer.response.read1, lambda error: BrokenOffError(trouble(error, server.WAIT_S)))
        have = _store(chunks, url, folder, seen, most, answer.begin, answer.total)
    if have < max(1, answer.total):
        of = f" of {answer.total}" if answer.total else ""
        raise BrokenOffError(Trouble(f"the server closed the connection after {have}{of} octets", NOBODY))


def _chunks(read: Callable[[int], bytes], broken: Callable[[Exception], Exception]) -> Iterator[bytes]:
    """Yield octets until the end. An error of read() is converted by broken() and raised."""
    while True:
        try:
            octets = read(CHUNK)
        except (OSError, http.client.HTTPException) as error:
            raise broken(error) from error
        if not octets:
            return
        yield octets


def _store(
    chunks: Iterator[bytes], name: str, folder: Folder, seen: Seen, most: int, begin: int = 0, total: int = 0
) -> int:
    """Write the octets from `begin` on; return the new size. total: room is reserved already; 0: check as they come."""
    have = begin
    with storing(folder.part), folder.part.open("r+b" if begin else "wb") as file:
        file.seek(begin)
        for octets in chunks:
            have += len(octets)
            _check_size(most, have, name, folder)
            if not total:
                folder.need(len(octets))
            file.write(octets)
            seen(have, total)
    return have


@contextmanager
def _kept(folder: Folder) -> Iterator[None]:
    """Remove the part after an error, unless it can be resumed."""
    try:
        yield
    except BaseException:  # includes KeyboardInterrupt
        if not _part(folder).has_rest:
            with suppress(StorageError):  # the original error is raised
                folder.clear()
        raise


def _check_size(most: int, size: int, name: str, folder: Folder) -> None:
    """Check a size. Raises StationError if it exceeds `most`, and removes the part."""
    if size > most:
        folder.clear()
        raise StationError(
            f"{name}: is {size / 1e6:.0f} MB or more; a bundle for this box has at most {most / 1e6:.0f} MB",
            NAME_ONE,
        )


def _part(folder: Folder) -> Part:
    """Return the state of the part: its octets, and the total size and tag that the server reported."""
    about = folder.about()
    size = about.get("size")
    try:
        octets = folder.part.stat().st_size
    except OSError:
        octets = 0
    return Part(octets, size if isinstance(size, int) else 0, str(about.get("tag") or ""))
