"""A bundle from a web server, or from a pipe, onto the data partition: it goes on where it was broken off."""

import http.client
import time
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from board.errors import StationError
from firmware.box import update_server
from firmware.box.update_folder import Folder, storing
from firmware.box.update_server import BrokenOffError

CHUNK = 1 << 16
PAUSES_S = (1.0, 2.0, 4.0, 8.0, 15.0)  # between tries that bring nothing, once something has come at all
NOBODY = "correct the address, or is the server gone, or the network?"
AGAIN = "captain update with the same address goes on where it was broken off"

Seen = Callable[[int, int], None]  # octets that are there; how many it will be, or 0


def is_url(source: str) -> bool:
    return source.startswith(("http://", "https://"))


def from_stream(stream: BinaryIO, folder: Folder, seen: Seen) -> Path:
    """Until its end. Raises StationError when there is no room."""
    folder.clear()
    have = 0
    with storing(folder.part), folder.part.open("wb") as file:
        while octets := _taken(stream):
            _put(file, octets, folder, is_counted=False)
            have += len(octets)
            seen(have, 0)
    return folder.finish()


def _taken(stream: BinaryIO) -> bytes:
    try:
        return stream.read(CHUNK)
    except OSError as error:
        raise StationError(f"the input cannot be read: {error.strerror}", "send the bundle once more") from error


def from_url(url: str, folder: Folder, seen: Seen, sleep: Callable[[float], None] = time.sleep) -> Path:
    """The file of an address. Raises StationError: why not; what is there already is kept for the next time.

    sleep  waits between two tries.
    """
    if folder.about().get("url") != url:
        folder.clear()
    first = before = _size(folder.part)
    tries = 0
    while True:
        try:
            _fetch(url, folder, seen)
            return folder.finish()
        except BrokenOffError as broken:
            have = _size(folder.part)
            tries = 0 if have > before else tries + 1
            if have == first:
                raise StationError(f"{url}: {broken}", AGAIN if have else NOBODY) from broken
            if tries >= len(PAUSES_S):
                raise StationError(f"{url}: {broken}; {have / 1e6:.1f} MB of it are there", AGAIN) from broken
            before = have
        sleep(PAUSES_S[tries])


def _fetch(url: str, folder: Folder, seen: Seen) -> None:
    """What is still missing of it, in one connection. Raises StationError, BrokenOffError."""
    have, about = _size(folder.part), folder.about()
    if have and have == about.get("size"):
        return  # it broke off behind the last octet
    answer = update_server.asked(url, have, str(about.get("tag") or ""))
    with answer.response:
        if answer.begin != have:
            have = 0
            folder.begin_again()  # before there is asked for room
        if answer.total:
            folder.need(answer.total - have)
        folder.note({"url": url, "tag": answer.tag, "size": answer.total})
        with storing(folder.part), folder.part.open("r+b" if have else "wb") as file:
            file.seek(have)
            while True:
                try:
                    octets = answer.response.read1(CHUNK)
                except (OSError, http.client.HTTPException) as error:
                    raise BrokenOffError(update_server.why(error)) from error
                if not octets:
                    break
                _put(file, octets, folder, is_counted=bool(answer.total))
                have += len(octets)
                seen(have, answer.total)
    if answer.total and have < answer.total:
        raise BrokenOffError(f"the server has ended the connection after {have} of {answer.total} octets")


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
