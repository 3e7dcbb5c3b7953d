"""What a web server answers to who asks for a file, or for the rest of one."""

import http.client
import re
import socket
import ssl
from typing import NamedTuple
from urllib.parse import SplitResult, quote, urljoin, urlsplit

from board.errors import StationError
from firmware.box.update_pace import Pace, TooSlowError, paced
from firmware.box.update_trouble import ASK, Trouble, trouble

WAIT_S = 30.0  # for a connection, an answer, the next octets
MOST_REDIRECTS = 5
AS_IT_IS = f"{ASK} to send it as it is"
LATER = "wait some minutes and try it once more"

# What another try may mend.
BREAKS = (
    ConnectionError, TimeoutError, socket.gaierror, http.client.HTTPException, ssl.SSLEOFError, ssl.SSLZeroReturnError,
)  # fmt: skip
SAFE = "/?%:@!$&'()*+,;=~"  # what an address has as it is; RFC 3986, clause 2
_HOST = re.compile(r"[^\x00-\x20\x7f]+")  # others are refused by http.client
# A name before the host; or a password with / ? or # in it, whose beginning stands where a port does.
_SOMEBODY = re.compile(r"(?:[^/?#]*:)?//(?:[^/?#]*@|[^/?#@\[:]*:(?!\d*(?:[/?#]|$))[^@]*@)")
_LENGTH = re.compile(r"\d{1,18}")
_RANGE = re.compile(r"bytes (\d{1,18})-\d{1,18}/(?:(\d{1,18})|\*)$")  # RFC 9110, clause 14.4
# What a portal, a login or a page of errors answers 200 with. text/plain is none of them: servers call so whatever ends
# in a way that they do not know.
_PAGES = {"text/html", "application/xhtml+xml", "application/json", "application/xml", "text/xml"}
# By what a file comes as it is. http.client unpacks chunks where nothing else is named, to the letter.
_PLAIN = {"Content-Encoding": ("", "identity"), "Transfer-Encoding": ("", "identity", "chunked")}
_STATUS = {
    206: Trouble("sends a part of the file, and was asked for all of it", ASK),
    401: Trouble("wants a name and a password, which this program does not send", "copy the bundle here by ssh"),
    403: Trouble("forbids it", f"{ASK}, or copy the bundle here by ssh"),
    404: Trouble("has no such file", "correct the address"),
    407: Trouble("wants a name and a password, which this program does not send", "copy the bundle here by ssh"),
    408: Trouble("has waited too long for the request", "try it once more"),
    410: Trouble("has no such file any more", "correct the address"),
    429: Trouble("is asked too often", LATER),
}


class Part(NamedTuple):
    """What is there already of a file: octets of how many, 0 where that is not known, and what the file was tagged."""

    octets: int = 0
    size: int = 0
    tag: str = ""


class Answer(NamedTuple):
    response: http.client.HTTPResponse
    begin: int  # octet of the file that the answer begins with
    total: int  # octets of the file; 0: not told
    tag: str  # what is another one for another file


class BrokenOffError(Exception):
    """The connection has ended before its time. trouble: with what."""

    def __init__(self, trouble: Trouble) -> None:
        super().__init__(trouble.words)
        self.trouble = trouble


class ChangedError(Exception):
    """The file is another one than that of the part: all of it is to be asked for."""


def asked(url: str, part: Part, pace: Pace) -> Answer:
    """The answer of the server that has the file, whoever had to be asked for it.

    Raises BrokenOffError, ChangedError, TooSlowError, and StationError where asking again is of no use.
    """
    where = url
    for _ in range(MOST_REDIRECTS):
        response = _request(url, where, part, pace)
        if response.status in (301, 302, 303, 307, 308):
            response.close()
            target = _led(url, where, response)
            if _parts(url, where).scheme == "https" != _parts(url, target).scheme:
                raise StationError(f"{url}: leads to {target}, which is not secure", "ask for that one by its name")
            where = target
        else:
            who = _on(url, where, ", which ") or "the server "
            _check_kind(url, who, response)
            _check_content(url, who, response)
            return _answer(url, who, response, part)
    raise StationError(f"{url}: leads from address to address", ASK)


def check_names_nobody(url: str) -> None:
    """Raises StationError for an address with a name or a password, which are told nobody."""
    if _SOMEBODY.match(url):
        raise StationError("a name and a password in an address are not sent", "leave them out")


def is_exact(tag: str) -> bool:
    """Whether it names a file to the octet, so that the rest of it can be asked for. RFC 9110, clause 13.1.5."""
    return bool(tag) and not tag.startswith("W/")


def _check_kind(url: str, who: str, response: http.client.HTTPResponse) -> None:
    """Raises StationError for what is answered by people's pages, or in parts, and not by a file."""
    if response.status not in (200, 206):
        return
    kind = response.headers.get_content_type()
    if kind.startswith("multipart/"):
        response.close()
        raise StationError(f"{url}: {who}sends parts ({kind}), and no bundle", AS_IT_IS)
    if kind in _PAGES:
        response.close()
        raise StationError(
            f"{url}: {who}sends a page ({kind}), and no bundle",
            "correct the address; or does the network want a login first? A browser shows the page",
        )


def _check_content(url: str, who: str, response: http.client.HTTPResponse) -> None:
    """Raises StationError for what is no file as it is: nothing at all, or packed though nobody asked for it."""
    for name, plain in _PLAIN.items():
        coding = ", ".join(response.headers.get_all(name, [])).lower()
        if response.status in (200, 206) and coding not in plain:
            response.close()
            raise StationError(f"{url}: {who}packs the file ({coding})", AS_IT_IS)
    if response.status == 200 and response.length == 0:
        response.close()
        raise StationError(f"{url}: {who}sends an empty file", "was it uploaded to its end?")


def _answer(url: str, who: str, response: http.client.HTTPResponse, part: Part) -> Answer:
    tag = response.getheader("ETag") or response.getheader("Last-Modified") or ""
    length = response.getheader("Content-Length") or ""
    size = int(length) if _LENGTH.fullmatch(length) else 0
    if response.status == 200:
        return Answer(response, 0, size, tag)
    if response.status == 206 and part.octets and is_exact(part.tag):
        found = _RANGE.match(response.getheader("Content-Range") or "")
        if found and int(found[1]) == part.octets and _is_of(part, response):
            total = int(found[2] or (part.octets + size if size else part.size))
            if not part.size or total == part.size:
                return Answer(response, part.octets, total, part.tag)
    response.close()
    if response.status in (206, 416) and part.octets:
        raise ChangedError
    raise _refused(url, who, response)


def _refused(url: str, who: str, response: http.client.HTTPResponse) -> StationError | BrokenOffError:
    """What is told of a status that brings no file."""
    status = f"{response.status} {response.reason}".strip()
    if response.status >= 500:
        return BrokenOffError(Trouble(f"{who}answers {status}", LATER))
    found = _STATUS.get(response.status, Trouble(f"answers {status}", ASK))
    if 200 <= response.status < 300 and response.status not in _STATUS:
        found = Trouble(f"sends no file ({status})", "correct the address")
    return StationError(f"{url}: {who}{found.words}", found.hint)


def _is_of(part: Part, response: http.client.HTTPResponse) -> bool:
    """Whether a rest is of the file that the part is of. Some servers leave its tag out, or make it a weak one."""
    tag, date = response.getheader("ETag"), response.getheader("Last-Modified")
    if tag and date != part.tag:
        return tag.removeprefix("W/") == part.tag
    return not date or date == part.tag or part.tag.startswith('"')


def _request(url: str, where: str, part: Part, pace: Pace) -> http.client.HTTPResponse:
    parts = _parts(url, where)
    headers = {"User-Agent": "captain", "Accept-Encoding": "identity", "Connection": "close"}
    if part.octets and is_exact(part.tag):
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
    except (OSError, ValueError, http.client.HTTPException) as error:
        connection.close()
        found = trouble(error, WAIT_S)
        words = f"{_on(url, where, ': ')}{found.words}"
        if isinstance(error, BREAKS):
            raise BrokenOffError(Trouble(words, found.hint)) from error
        raise StationError(f"{url}: {words}", found.hint) from error


def _on(url: str, where: str, joined: str) -> str:
    """How a sentence begins about where an address has led to, if it has led on."""
    return f"leads to {where}{joined}" if where != url else ""


def _parts(url: str, where: str) -> SplitResult:
    """Of where an address has led to. Raises StationError."""
    try:
        parts = urlsplit(where)
        host = parts.hostname or ""
        is_one = parts.scheme in ("http", "https") and bool(_HOST.fullmatch(host))
        host.encode("idna")  # as the system's resolver is asked for it: parts of 1 to 63 octets
    except ValueError:
        is_one = False
    if not is_one:
        hint = "https://HOST/PATH is one" if where == url else ASK
        raise StationError(f"{url}: {_on(url, where, ', which ')}is no address of a file", hint)
    try:
        port = parts.port
    except ValueError:
        port = 0
    if port == 0:
        what = f"{url}: {_on(url, where, ', where ')}there is no port {parts.netloc.rpartition(':')[2]}"
        raise StationError(what, "one of 1 to 65535" if where == url else ASK)
    return parts


def _led(url: str, where: str, response: http.client.HTTPResponse) -> str:
    """Where a server sends on to. Raises StationError."""
    to = response.getheader("Location") or ""
    if not to:
        what = f"the server answers {response.status} {response.reason}, and not where to"
        raise StationError(f"{url}: {_on(url, where, ': ')}{what}", ASK)
    try:
        target = urljoin(where, to)
    except ValueError:
        target = to  # no address, as is told of it
    if _SOMEBODY.match(target):
        raise StationError(f"{url}: leads to an address with a name and a password, which are not sent", ASK)
    return target


def _connection(parts: SplitResult) -> http.client.HTTPConnection:
    assert parts.hostname is not None
    if parts.scheme == "http":
        return http.client.HTTPConnection(parts.hostname, parts.port or http.client.HTTP_PORT, timeout=WAIT_S)
    port, context = parts.port or http.client.HTTPS_PORT, ssl.create_default_context()
    return http.client.HTTPSConnection(parts.hostname, port, timeout=WAIT_S, context=context)
