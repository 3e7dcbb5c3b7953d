"""A web server with one file, and with faults, and how that is fetched."""

import http.server
import random
import re
import ssl
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import BinaryIO
from urllib.parse import unquote

from firmware.update import fetch as update_fetch
from firmware.update.folder import Folder
from tests.broker.certificates import LOOPBACK, Authority

MOST = 20_000_000  # octets of a bundle
FILE = random.Random(7).randbytes(300_000)


class Server(http.server.BaseHTTPRequestHandler):
    """A file at /update, with faults.

    cuts      octets after which the connection is closed, a number for each request; then none.
    """

    cuts: list[int]
    tag: str
    has_ranges: bool
    has_length: bool
    is_chunked: bool
    asked: list[tuple[str, str | None]]
    status: int
    always_begins = 0  # octet of the file, whatever is asked for; 0: as it is asked
    leads = ""  # where to, where that is not told by the path behind /to/
    kind = ""  # Content-Type
    length = ""  # what it says in place of the length
    coding = ""  # Content-Encoding
    transfer = ""  # Transfer-Encoding, in place of what it is
    date = ""  # Last-Modified
    ends_early = False  # of an answer in chunks: without the last one
    minds_changes = True  # If-Range is looked at

    def do_GET(self) -> None:
        wanted = self.headers.get("Range")
        self.asked.append((self.path, wanted))
        if self.path.startswith("/to/"):
            self.send_response(302)
            self.send_header("Location", self.leads or unquote(self.path).removeprefix("/to/"))
            self.end_headers()
            return
        if self.status != 200:
            self.send_error(self.status)
            return
        begin = self.always_begins
        is_same = not self.minds_changes or self.headers.get("If-Range") == self.tag
        if begin or (wanted and self.has_ranges and is_same):
            begin = begin or int(re.findall(r"\d+", str(wanted))[0])
            if begin >= len(FILE):
                self.send_error(416)
                return
            self.send_response(206)
            self.send_header("Content-Range", f"bytes {begin}-{len(FILE) - 1}/{len(FILE)}")
        else:
            self.send_response(200)
        if transfer := self.transfer or ("chunked" if self.is_chunked else ""):
            self.send_header("Transfer-Encoding", transfer)
        if self.has_length and not self.is_chunked:
            self.send_header("Content-Length", self.length or str(len(FILE) - begin))
        if self.tag:
            self.send_header("ETag", self.tag)
        if self.date:
            self.send_header("Last-Modified", self.date)
        if self.kind:
            self.send_header("Content-Type", self.kind)
        if self.coding:
            self.send_header("Content-Encoding", self.coding)
        self.send_header("Connection", "close")
        self.end_headers()
        octets = FILE[begin:]
        octets = octets[: self.cuts.pop(0)] if self.cuts else octets
        if self.is_chunked:
            octets = b"%x\r\n%s\r\n" % (len(octets), octets) + (b"" if self.ends_early else b"0\r\n\r\n")
        self.wfile.write(octets)

    def log_message(self, format: str, *arguments: object) -> None:  # noqa: A002
        """Of no use here."""


class Site:
    """One that runs. url: of the file."""

    def __init__(self, context: ssl.SSLContext | None = None) -> None:
        class Own(Server):
            cuts: list[int] = []  # noqa: RUF012 - a class for each site
            tag, has_ranges, has_length, is_chunked, status = '"1"', True, True, False, 200
            asked: list[tuple[str, str | None]] = []  # noqa: RUF012

        self.does = Own
        self._server = http.server.HTTPServer(("127.0.0.1", 0), Own)
        if context:
            self._server.socket = context.wrap_socket(self._server.socket, server_side=True)
        self.base = f"http{'s' if context else ''}://localhost:{self._server.server_address[1]}"
        self.url = f"{self.base}/update"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,))

    @contextmanager
    def open(self) -> Iterator["Site"]:
        self._thread.start()
        try:
            yield self
        finally:
            self._server.shutdown()
            self._thread.join()
            self._server.server_close()


@contextmanager
def secure(authority: Authority, hosts: Sequence[str] = LOOPBACK) -> Iterator[Site]:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    pair = authority.server(hosts)
    context.load_cert_chain(pair.certificate, pair.key)
    with Site(context).open() as found:
        yield found


def fetch(
    url: str,
    folder: Folder,
    seen: Callable[[int, int], None] = lambda have, size: None,
    clock: Callable[[], float] = lambda: 0.0,
    most: int = MOST,
) -> bytes:
    return update_fetch.from_url(url, folder, seen, most, lambda seconds: None, clock).read_bytes()


def piped(stream: BinaryIO, folder: Folder) -> bytes:
    return update_fetch.from_stream(stream, folder, lambda have, size: None, MOST).read_bytes()
