"""What a web server answers to who asks for a file, or for the rest of one."""

import http.client
import re
import socket
import ssl
import time
from typing import NamedTuple
from urllib.parse import SplitResult, quote, urljoin, urlsplit

from board.errors import StationError
from firmware.box import update_trouble
from firmware.box.update_pace import Pace, TooSlowError, paced
from firmware.made_up import is_clock_set

WAIT_S = 30.0  # for a connection, an answer, the next octets
MOST_REDIRECTS = 5
ASK = "ask whoever runs the server"
NOT_YET_VALID = 9  # X509_V_ERR_CERT_NOT_YET_VALID

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
_STATUS = {
    401: "wants a name and a password, which this program does not send",
    403: "forbids it",
    404: "has no such file",
    410: "has no such file any more",
}


class Answer(NamedTuple):
    response: http.client.HTTPResponse
    begin: int  # octet of the file that the answer begins with
    total: int  # octets of the file; 0: not told
    tag: str  # what is another one for another file


class BrokenOffError(Exception):
    """The connection has ended before its time."""


def asked(url: str, have: int, tag: str, pace: Pace) -> Answer:
    """The answer of the server that has the file, whoever had to be asked for it.

    have  octets that are there already, of the file that had this tag.

    Raises BrokenOffError, TooSlowError, and StationError where asking again is of no use.
    """
    where = url
    for _ in range(MOST_REDIRECTS):
        response = _request(url, where, have, tag, pace)
        if response.status in (301, 302, 303, 307, 308):
            response.close()
            target = _led(url, where, response)
            if _parts(url, where).scheme == "https" != _parts(url, target).scheme:
                raise StationError(f"{_named(url, target)} is not secure", "ask for that one by its name")
            where = target
        elif response.status == 416 and have:  # there is nothing behind what is there
            response.close()
            have, tag = 0, ""
        else:
            _check_kind(url, where, response)
            _check_content(url, response)
            return _answer(url, response, have)
        response.close()
    raise StationError(f"{url}: leads from address to address", ASK)


def check_names_nobody(url: str) -> None:
    """Raises StationError for an address with a name or a password, which are told nobody."""
    if _SOMEBODY.match(url):
        raise StationError("a name and a password in an address are not sent", "leave them out")


def is_exact(tag: str) -> bool:
    """Whether it names a file to the octet, so that the rest of it can be asked for. RFC 9110, clause 13.1.5."""
    return bool(tag) and not tag.startswith("W/")


def _check_kind(url: str, where: str, response: http.client.HTTPResponse) -> None:
    """Raises StationError for what is answered by people's pages, and not by a file."""
    if response.status in (200, 206) and (kind := response.headers.get_content_type()) in _PAGES:
        response.close()
        led = f"leads to {where}, which" if where != url else "the server"
        raise StationError(
            f"{url}: {led} sends a page ({kind}), and no bundle",
            "correct the address; or does the network want a login first? A browser shows the page",
        )


def _check_content(url: str, response: http.client.HTTPResponse) -> None:
    """Raises StationError for what is no file as it is: nothing at all, or packed though nobody asked for it."""
    coding = response.headers.get("Content-Encoding", "identity").strip().lower()
    if response.status in (200, 206) and coding not in ("", "identity"):
        response.close()
        raise StationError(f"{url}: the server packs the file ({coding})", "ask whoever runs it to send it as it is")
    if response.status == 200 and response.length == 0:
        response.close()
        raise StationError(f"{url}: the server sends an empty file", "was it uploaded to its end?")


def why(error: Exception) -> str:
    """What a connection ended with, or why there is none."""
    return update_trouble.why(error, WAIT_S)


def _answer(url: str, response: http.client.HTTPResponse, have: int) -> Answer:
    tag = response.getheader("ETag") or response.getheader("Last-Modified") or ""
    length = response.getheader("Content-Length") or ""
    size = int(length) if _LENGTH.fullmatch(length) else 0
    if response.status == 200:
        return Answer(response, 0, size, tag)
    found = _RANGE.match(response.getheader("Content-Range") or "")
    if response.status == 206 and have and found and int(found[1]) == have:
        return Answer(response, have, int(found[2] or (have + size if size else 0)), tag)
    response.close()
    if response.status >= 500:
        raise BrokenOffError(f"the server answers {response.status} {response.reason}")
    said = _STATUS.get(response.status, f"answers {response.status} {response.reason}")
    raise StationError(f"{url}: the server {said}", "correct the address")


def _request(url: str, where: str, have: int, tag: str, pace: Pace) -> http.client.HTTPResponse:
    parts = _parts(url, where)
    named = _named(url, where, "where")
    headers = {"User-Agent": "captain", "Accept-Encoding": "identity", "Connection": "close"}
    if have and is_exact(tag):
        headers |= {"Range": f"bytes={have}-", "If-Range": tag}
    connection = _connection(parts)
    connection.response_class = paced(pace)
    path = quote(f"{parts.path or '/'}{'?' + parts.query if parts.query else ''}", SAFE, errors="surrogateescape")
    try:
        connection.request("GET", path, headers=headers)
        return connection.getresponse()
    except TooSlowError:
        connection.close()
        raise
    except ssl.SSLCertVerificationError as error:
        raise _distrusted(named, error) from error
    except BREAKS as error:
        connection.close()
        raise BrokenOffError(why(error)) from error
    except ssl.SSLError as error:
        connection.close()
        hint = "is it an address with http://?" if update_trouble.is_no_tls(error) else ASK
        raise StationError(f"{named} {why(error)}", hint) from error
    except (OSError, ValueError) as error:
        connection.close()
        raise StationError(f"{named} {why(error)}", "is the network there? captain doctor") from error


def _named(url: str, where: str, joined: str = "which") -> str:
    """How a sentence begins about where an address has led to."""
    return f"{url}:" if where == url else f"{url}: leads to {where}, {joined}"


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
        raise StationError(f"{_named(url, where)} is no address of a file", hint)
    try:
        port = parts.port
    except ValueError:
        port = 0
    if port == 0:
        what = f"{_named(url, where, 'where')} there is no port {parts.netloc.rpartition(':')[2]}"
        raise StationError(what, "one of 1 to 65535" if where == url else ASK)
    return parts


def _led(url: str, where: str, response: http.client.HTTPResponse) -> str:
    """Where a server sends on to. Raises StationError."""
    to = response.getheader("Location") or ""
    if not to:
        what = f"the server answers {response.status} {response.reason}, and not where to"
        raise StationError(f"{_named(url, where, 'where')} {what}", ASK)
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


def _distrusted(named: str, error: ssl.SSLCertVerificationError) -> StationError:
    if error.verify_code == NOT_YET_VALID and not is_clock_set():
        now = time.strftime("%Y-%m-%d", time.gmtime())
        return StationError(
            f"{named} the server's certificate is not valid yet, for the clock of this box was not set: it says {now}",
            "wait for a receiver or a server to set it (captain time), or copy the bundle here by ssh",
        )
    return StationError(f"{named} {why(error)}", "the authorities are those of the image")
