"""A bundle from a web server, or from a pipe, onto the data partition: it goes on where it was broken off."""

import http.client
import re
import socket
import ssl
import time
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, NamedTuple
from urllib.parse import SplitResult, quote, urljoin, urlsplit

from board.errors import StationError
from firmware.box import update_trouble
from firmware.box.update_folder import Folder, storing
from firmware.made_up import is_clock_set

CHUNK = 1 << 16
WAIT_S = 30.0  # for a connection, an answer, the next octets
MOST_REDIRECTS = 5
PAUSES_S = (1.0, 2.0, 4.0, 8.0, 15.0)  # between tries that bring nothing, once something has come at all
NOT_YET_VALID = 9  # X509_V_ERR_CERT_NOT_YET_VALID
NOBODY = "correct the address, or is the server gone, or the network?"
AGAIN = "captain update with the same address goes on where it was broken off"

Seen = Callable[[int, int], None]  # octets that are there; how many it will be, or 0
SAFE = "/?%:@!$&'()*+,;=~"  # what an address has as it is; RFC 3986, clause 2
_HOST = re.compile(r"[^\x00-\x20\x7f]+")  # others are refused by http.client
_LENGTH = re.compile(r"\d{1,18}")
_RANGE = re.compile(r"bytes (\d{1,18})-\d{1,18}/(?:(\d{1,18})|\*)$")  # RFC 9110, clause 14.4
_STATUS = {
    401: "wants a name and a password, which this program does not send",
    403: "forbids it",
    404: "has no such file",
    410: "has no such file any more",
}


class _Answer(NamedTuple):
    response: http.client.HTTPResponse
    begin: int  # octet of the file that the answer begins with
    total: int  # octets of the file; 0: not told
    tag: str  # what is another one for another file


class _BrokenOffError(Exception):
    """The connection has ended before its time."""


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
        except _BrokenOffError as broken:
            have = _size(folder.part)
            tries = 0 if have > before else tries + 1
            if have == first:
                raise StationError(f"{url}: {broken}", AGAIN if have else NOBODY) from broken
            if tries >= len(PAUSES_S):
                raise StationError(f"{url}: {broken}; {have / 1e6:.1f} MB of it are there", AGAIN) from broken
            before = have
        sleep(PAUSES_S[tries])


def _fetch(url: str, folder: Folder, seen: Seen) -> None:
    """What is still missing of it, in one connection. Raises StationError, _BrokenOffError."""
    have, about = _size(folder.part), folder.about()
    if have and have == about.get("size"):
        return  # it broke off behind the last octet
    answer = _asked(url, have, str(about.get("tag") or ""))
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
                    raise _BrokenOffError(_why(error)) from error
                if not octets:
                    break
                _put(file, octets, folder, is_counted=bool(answer.total))
                have += len(octets)
                seen(have, answer.total)
    if answer.total and have < answer.total:
        raise _BrokenOffError(f"the server has ended the connection after {have} of {answer.total} octets")


def _asked(url: str, have: int, tag: str) -> _Answer:
    """The answer of the server that has the file, whoever had to be asked for it."""
    where = url
    for _ in range(MOST_REDIRECTS):
        response = _request(where, have, tag)
        if response.status in (301, 302, 303, 307, 308):
            target = _led(where, response.getheader("Location") or "")
            if where.startswith("https://") and not target.startswith("https://"):
                raise StationError(f"{where}: leads to {target}, which is not secure", "ask for that one by its name")
            where = target
        elif response.status == 416 and have:  # there is nothing behind what is there
            response.close()
            have, tag = 0, ""
        else:
            return _answer(url, response, have)
        response.close()
    raise StationError(f"{url}: leads from address to address", "ask whoever runs the server")


def _answer(url: str, response: http.client.HTTPResponse, have: int) -> _Answer:
    tag = response.getheader("ETag") or response.getheader("Last-Modified") or ""
    length = response.getheader("Content-Length") or ""
    size = int(length) if _LENGTH.fullmatch(length) else 0
    if response.status == 200:
        return _Answer(response, 0, size, tag)
    found = _RANGE.match(response.getheader("Content-Range") or "")
    if response.status == 206 and found and int(found[1]) == have:
        return _Answer(response, have, int(found[2] or (have + size if size else 0)), tag)
    response.close()
    if response.status >= 500:
        raise _BrokenOffError(f"the server answers {response.status} {response.reason}")
    why = _STATUS.get(response.status, f"answers {response.status} {response.reason}")
    raise StationError(f"{url}: the server {why}", "correct the address")


def _request(url: str, have: int, tag: str) -> http.client.HTTPResponse:
    parts = _parts(url)
    headers = {"User-Agent": "captain", "Accept-Encoding": "identity", "Connection": "close"}
    if have and tag and not tag.startswith("W/"):
        headers |= {"Range": f"bytes={have}-", "If-Range": tag}
    connection = _connection(parts)
    path = quote(f"{parts.path or '/'}{'?' + parts.query if parts.query else ''}", SAFE, errors="surrogateescape")
    try:
        connection.request("GET", path, headers=headers)
        return connection.getresponse()
    except ssl.SSLCertVerificationError as error:
        raise _distrusted(url, error) from error
    except (ConnectionError, TimeoutError, socket.gaierror, http.client.HTTPException) as error:
        connection.close()
        raise _BrokenOffError(_why(error)) from error
    except (OSError, ValueError) as error:
        connection.close()
        raise StationError(f"{url}: {_why(error)}", "is the network there? captain doctor") from error


def _parts(url: str) -> SplitResult:
    """Raises StationError."""
    try:
        parts = urlsplit(url)
        is_one = parts.scheme in ("http", "https") and bool(_HOST.fullmatch(parts.hostname or ""))
    except ValueError:
        is_one = False
    if not is_one:
        raise StationError(f"{url}: is no address of a file", "https://HOST/PATH is one")
    return parts


def _led(where: str, to: str) -> str:
    """Where a server sends on to. Raises StationError."""
    try:
        return urljoin(where, to)
    except ValueError as error:
        raise StationError(f"{where}: leads to {to!r}, which is no address", "ask whoever runs the server") from error


def _connection(parts: SplitResult) -> http.client.HTTPConnection:
    assert parts.hostname is not None
    try:
        port = parts.port or (http.client.HTTP_PORT if parts.scheme == "http" else http.client.HTTPS_PORT)
    except ValueError as error:
        raise StationError(f"{parts.geturl()}: {error}", "a port is 1 to 65535") from error
    if parts.scheme == "http":
        return http.client.HTTPConnection(parts.hostname, port, timeout=WAIT_S)
    return http.client.HTTPSConnection(parts.hostname, port, timeout=WAIT_S, context=ssl.create_default_context())


def _distrusted(url: str, error: ssl.SSLCertVerificationError) -> StationError:
    if error.verify_code == NOT_YET_VALID and not is_clock_set():
        now = time.strftime("%Y-%m-%d", time.gmtime())
        return StationError(
            f"{url}: the server's certificate is not valid yet, for the clock of this box was not set: it says {now}",
            "wait for a receiver or a server to set it (captain time), or copy the bundle here by ssh",
        )
    return StationError(f"{url}: {_why(error)}", "the authorities are those of the image")


def _why(error: Exception) -> str:
    return update_trouble.why(error, WAIT_S)


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
