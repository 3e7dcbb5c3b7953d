"""A bundle from a web server, or from a pipe, onto the data partition: it goes on where it was broken off."""

import http.client
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from board.errors import StationError, StorageError
from firmware.box import update_server
from firmware.box.update_folder import Folder, storing
from firmware.box.update_pace import Pace, TooSlowError
from firmware.box.update_server import BrokenOffError, ChangedError, Part
from firmware.box.update_trouble import ASK, NOBODY, Trouble, trouble

CHUNK = 1 << 16
PAUSES_S = (1.0, 2.0, 4.0, 8.0, 15.0)  # between tries that bring nothing, once something has come at all
NAME_ONE = "name a bundle, captain-VERSION-arm64.raucb"
INPUT = "the input"
ANEW = "captain update with the same address begins anew: its server does not tell how to go on"
AGAIN = "captain update with the same address goes on where it was broken off"

Seen = Callable[[int, int], None]  # octets that are there; how many it will be, or 0


def is_url(source: str) -> bool:
    return source.lower().startswith(("http://", "https://"))


def from_stream(stream: BinaryIO, folder: Folder, seen: Seen, most: int) -> Path:
    """Until its end. Raises StationError when there is no room, and for more than most octets."""
    folder.clear()
    have = 0
    with _kept(folder), storing(folder.part), folder.part.open("wb") as file:
        while octets := _taken(stream):
            have += len(octets)
            _check_size(most, have, INPUT, folder)
            _put(file, octets, folder, is_counted=False)
            seen(have, 0)
    return folder.finish()


def _taken(stream: BinaryIO) -> bytes:
    try:
        return stream.read(CHUNK)
    except OSError as error:
        raise StationError(f"{INPUT} cannot be read: {error.strerror}", "send the bundle once more") from error


def from_url(
    url: str,
    folder: Folder,
    seen: Seen,
    most: int,
    sleep: Callable[[float], None] = time.sleep,
    clock: Callable[[], float] = time.monotonic,
) -> Path:
    """The file of an address. Raises StationError: why not; what can be gone on with is kept for the next time.

    most   octets that it may have.
    sleep  waits between two tries.
    """
    if folder.about().get("url") != url:
        folder.clear()
    first = before = _size(folder.part)
    tries, pace = 0, Pace(clock)
    with _kept(folder):
        while True:
            try:
                _fetch(url, folder, seen, most, pace)
                return folder.finish()
            except TooSlowError as slow:
                raise _ended(url, Trouble(f"{slow}", NOBODY), folder) from slow
            except BrokenOffError as broken:
                have = _size(folder.part)
                tries = 0 if have > before else tries + 1
                if have == first or tries >= len(PAUSES_S):
                    raise _ended(url, broken.trouble, folder) from broken
                before = have
            sleep(PAUSES_S[tries])


def _ended(url: str, why: Trouble, folder: Folder) -> StationError:
    """What is told of an address that is not tried any more."""
    have = _size(folder.part)
    if not have:
        return StationError(f"{url}: {why.words}", why.hint)
    return StationError(f"{url}: {why.words}; {have / 1e6:.1f} MB of it had come", AGAIN if _goes_on(folder) else ANEW)


def _fetch(url: str, folder: Folder, seen: Seen, most: int, pace: Pace) -> None:
    """What is still missing of it, in one connection. Raises StationError, BrokenOffError, TooSlowError."""
    have, about = _size(folder.part), folder.about()
    if have and have == about.get("size"):
        return  # it broke off behind the last octet
    size = about.get("size")
    part = Part(have, size if isinstance(size, int) else 0, str(about.get("tag") or ""))
    try:
        answer = update_server.asked(url, part, pace)
    except ChangedError:
        folder.clear()
        answer = update_server.asked(url, Part(), pace)
    with answer.response:
        _check_size(most, answer.total, url, folder)
        if answer.begin != have:
            have = 0
            folder.clear()  # before there is asked for room
        if answer.total:
            folder.need(answer.total - have)
        folder.note({"url": url, "tag": answer.tag, "size": answer.total})
        with storing(folder.part), folder.part.open("r+b" if have else "wb") as file:
            file.seek(have)
            while True:
                try:
                    octets = answer.response.read1(CHUNK)
                except (OSError, http.client.HTTPException) as error:
                    raise BrokenOffError(trouble(error, update_server.WAIT_S)) from error
                if not octets:
                    break
                have += len(octets)
                _check_size(most, have, url, folder)
                _put(file, octets, folder, is_counted=bool(answer.total))
                seen(have, answer.total)
    if not have:
        raise BrokenOffError(Trouble("the server has ended the connection before the first octet", ASK))
    if answer.total and have < answer.total:
        raise BrokenOffError(
            Trouble(f"the server has ended the connection after {have} of {answer.total} octets", NOBODY)
        )


@contextmanager
def _kept(folder: Folder) -> Iterator[None]:
    """What is there when it breaks off stays where it can be gone on with."""
    try:
        yield
    except BaseException:  # Ctrl-C is one
        if not _goes_on(folder):
            with suppress(StorageError):  # it is told what it broke off with
                folder.clear()
        raise


def _goes_on(folder: Folder) -> bool:
    """Whether the rest of the part can be asked for, and its end be known."""
    about = folder.about()
    return bool(about.get("size")) and update_server.is_exact(str(about.get("tag") or ""))


def _check_size(most: int, size: int, name: str, folder: Folder) -> None:
    """Raises StationError for more octets than any bundle has, and nothing of them stays."""
    if size > most:
        folder.clear()
        raise StationError(
            f"{name}: is {size / 1e6:.0f} MB or more, and a bundle for this box has {most / 1e6:.0f} MB at most",
            NAME_ONE,
        )


def _put(file: BinaryIO, octets: bytes, folder: Folder, is_counted: bool) -> None:
    """is_counted: there was room for all of it when it began."""
    if not is_counted:
        folder.need(len(octets))
    file.write(octets)


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0
