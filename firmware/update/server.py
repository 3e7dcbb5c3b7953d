"""HTTP requests for a bundle: whole, or from an offset."""

import http.client
import re
import socket
import ssl
from typing import NamedTuple
from urllib.parse import SplitResult, quote, urljoin, urlsplit

from board.runtime.errors import StationError
from firmware.update.pace import Pace, TooSlowError, paced
from firmware.update.trouble import ASK, Trouble, trouble

WAIT_S = 30.0  # limit for a connection, an answer, and the next octets
MOST_REDIRECTS = 5
LATER = "wait some minutes and try again"
# Errors after which another try may help.
BREAKS = (
    ConnectionError, TimeoutError, socket.gaierror, http.client.HTTPException, ssl.SSLEOFError, ssl.SSLZeroReturnError,
)  # fmt: skip
SAFE = "/?%:@!$&'()*+,;=~"  # characters of an address that are not escaped; RFC 3986, clause 2
_HOST = re.compile(r"[^\x00-\x20\x7f]+")  # http.client refuses other characters
# A user name before the host; or a password with / ? or # in it, so that its beginning is at the place of a port.
_SOMEBODY = re.compile(r"(?:[^/?#]*:)?//(?:[^/?#]*@|[^/?#@\[:]*:(?!\d*(?:[/?#]|$))[^@]*@)")
_LENGTH = re.compile(r"\d{1,18}")
_RANGE = re.compile(r"bytes (\d{1,18})-\d{1,18}/(\d{1,18})$")  # RFC 9110, clause 14.4
# Content types of portals, logins and error pages, which answer with status 200. text/plain is missing here, because
# servers use it for unknown file endings.
_PAGES = ("text/html", "application/xhtml+xml", "application/json", "application/xml", "text/xml")
STATUS = {
    401: Trouble("requires a name and password, which this program does not send", "copy the bundle here by ssh"),
    403: Trouble("forbids it", f"{ASK}, or copy the bundle here by ssh"),
    404: Trouble("has no such file", "correct the address"),
    429: Trouble("reports too many requests", LATER),
}


class Part(NamedTuple):
    """Received part of a file. size: octets of the whole file; 0: unknown. tag: of its content; empty: unknown."""

    octets: int = 0
    size: int = 0
    tag: str = ""

    @property
    def has_rest(self) -> bool:
        """True if the rest can be requested and its end is known."""
        return bool(self.octets and self.size and self.tag)


class Answer(NamedTuple):
    response: http.client.HTTPResponse
    begin: int  # offset of the answer's first octet in the file
    total: int  # octets of the file; 0: unknown
    tag: str  # strong tag of its content; empty: unknown


class BrokenOffError(Exception):
    """The connection ended too early. trouble: the cause."""

    def __init__(self, trouble: Trouble) -> None:
        super().__init__(trouble.words)
        self.trouble = trouble


class ChangedError(Exception):
    """The file on the server is not that of the part, so it must be fetched from its beginning."""


def asked(url: str, part: Part, pace: Pace) -> Answer:
    """Request a file; return the server's answer, after following redirects.

    Raises BrokenOffError if another try may help, ChangedError if the file changed, TooSlowError if too little came,
    and StationError for permanent failures.
    """
    where = url
    for _ in range(MOST_REDIRECTS):
        response = _request(url, where, part, pace)
        if response.status not in (301, 302, 303, 307, 308):
            return _answer(url, "the server " if where == url else f"redirects to {where}, which ", response, part)
        response.close()
        where = _led(url, where, response.getheader("Location") or "")
    raise StationError(f"{url}: too many redirects", ASK)


def check_names_nobody(url: str) -> None:
    """Check an address. Raises StationError, without showing them, if it has a user name or a password."""
    if _SOMEBODY.match(url):
        raise StationError("name and password in an address are not supported", "leave them out")


def _answer(url: str, who: str, response: http.client.HTTPResponse, part: Part) -> Answer:
    """Return the answer if it contains the file. Raises the errors of asked() otherwise."""
    length = response.getheader("Content-Length") or ""
    tag = response.getheader("ETag") or response.getheader("Last-Modified") or ""
    kind = response.headers.get_content_type()
    if response.status in (200, 206) and kind.startswith((*_PAGES, "multipart/")):
        response.close()
        hint = "check the address, and open it in a browser: the network may require a login"
        raise StationError(f"{url}: {who}sends a page ({kind}) in place of a bundle", hint)
    if response.status == 200:
        # A weak tag does not identify the octets of a file; RFC 9110, clause 13.1.5.
        size = int(length) if _LENGTH.fullmatch(length) else 0
        return Answer(response, 0, size, "" if tag.startswith("W/") else tag)
    if response.status == 206 and part.has_rest and _is_of(part, response):
        return Answer(response, part.octets, part.size, part.tag)
    response.close()
    if response.status in (206, 416) and part.octets:
        raise ChangedError
    status = f"answers {response.status} {response.reason}".strip()
    if response.status >= 500:
        raise BrokenOffError(Trouble(f"{who}{status}", LATER))
    found = STATUS.get(response.status, Trouble(status, ASK))
    raise StationError(f"{url}: {who}{found.words}", found.hint)


def _is_of(part: Part, response: http.client.HTTPResponse) -> bool:
    """Return whether the answer is the rest of this file. Some servers omit the tag here, or send it as a weak one."""
    found = _RANGE.match(response.getheader("Content-Range") or "")
    is_date = part.tag.endswith(" GMT")  # RFC 9110, clause 5.6.7
    tag = (response.getheader("Last-Modified" if is_date else "ETag") or part.tag).removeprefix("W/")
    return found is not None and (int(found[1]), int(found[2]), tag) == (part.octets, part.size, part.tag)


def _request(url: str, where: str, part: Part, pace: Pace) -> http.client.HTTPResponse:
    parts = _parts(url, where)
    headers = {"User-Agent": "captain", "Accept-Encoding": "identity", "Connection": "close"}
    if part.has_rest:
        headers |= {"Range": f"bytes={part.octets}-", "If-Range": part.tag}
    connection = _connection(parts)
    connection.response_class = paced(pace)
    path = quote(f"{parts.path or '/'}{'?' + parts.query if parts.query else ''}", SAFE, errors="surrogateescape")
    try:
        connection.request("GET", path, headers=headers)
        return connection.getresponse()
    except TooSlowError:
        connection.close()
        raise
    except (OSError, http.client.HTTPException) as error:
        connection.close()
        found = trouble(error, WAIT_S)
        words = found.words if where == url else f"redirects to {where}: {found.words}"
        if isinstance(error, BREAKS):
            raise BrokenOffError(Trouble(words, found.hint)) from error
        raise StationError(f"{url}: {words}", found.hint) from error


def _led(url: str, where: str, to: str) -> str:
    """Return the target of a redirect. Raises StationError if it is invalid, has a password or leaves https."""
    try:
        target = urljoin(where, to)
    except ValueError:
        target = to  # _parts() will refuse it
    if _SOMEBODY.match(target):
        raise StationError(f"{url}: redirects to an address with name and password, which are not supported", ASK)
    if _parts(url, where).scheme == "https" != _parts(url, target).scheme:
        raise StationError(f"{url}: redirects to {target}, which is not secure", "use that address")
    return target


def _parts(url: str, where: str) -> SplitResult:
    """Return the parts of an address or redirect. Raises StationError if it is invalid."""
    try:
        parts = urlsplit(where)
        host = parts.hostname or ""
        is_one = parts.scheme in ("http", "https") and bool(_HOST.fullmatch(host)) and parts.port != 0
        host.encode("idna")  # the resolver needs this form: labels of 1 to 63 octets
    except ValueError:
        is_one = False
    if not is_one and where == url:
        raise StationError(f"{url}: invalid address of a file", "use https://HOST[:PORT]/PATH")
    if not is_one:
        raise StationError(f"{url}: redirects to {where}, which is not an address of a file", ASK)
    return parts


def _connection(parts: SplitResult) -> http.client.HTTPConnection:
    host = parts.hostname
    assert host  # _parts() has checked it
    if parts.scheme == "http":
        return http.client.HTTPConnection(host, parts.port or http.client.HTTP_PORT, timeout=WAIT_S)
    port, context = parts.port or http.client.HTTPS_PORT, ssl.create_default_context()
    return http.client.HTTPSConnection(host, port, timeout=WAIT_S, context=context)
