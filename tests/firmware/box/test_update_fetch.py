"""Bundles from web servers of every kind, broken off and gone on with."""

import errno
import http.server
import io
import itertools
import json
import os
import random
import re
import socket
import ssl
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote

import pytest

from board.errors import StationError, StorageError
from firmware.box import update_fetch, update_server
from firmware.box.update_folder import Folder
from firmware.box.update_pace import Pace, TooSlowError
from tests.broker.certificates import Authority

FILE = random.Random(7).randbytes(300_000)
MOST = 20_000_000


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
    kind = ""  # Content-Type
    length = ""  # what it says in place of the length

    def do_GET(self) -> None:
        wanted = self.headers.get("Range")
        self.asked.append((self.path, wanted))
        if self.path.startswith("/to/"):
            self.send_response(302)
            self.send_header("Location", unquote(self.path).removeprefix("/to/"))
            self.end_headers()
            return
        if self.status != 200:
            self.send_error(self.status)
            return
        begin = 0
        if wanted and self.has_ranges and self.headers.get("If-Range") == self.tag:
            begin = int(re.findall(r"\d+", wanted)[0])
            if begin >= len(FILE):
                self.send_error(416)
                return
            self.send_response(206)
            self.send_header("Content-Range", f"bytes {begin}-{len(FILE) - 1}/{len(FILE)}")
        else:
            self.send_response(200)
        if self.is_chunked:
            self.send_header("Transfer-Encoding", "chunked")
        elif self.has_length:
            self.send_header("Content-Length", self.length or str(len(FILE) - begin))
        self.send_header("ETag", self.tag)
        if self.kind:
            self.send_header("Content-Type", self.kind)
        self.send_header("Connection", "close")
        self.end_headers()
        octets = FILE[begin:]
        octets = octets[: self.cuts.pop(0)] if self.cuts else octets
        self.wfile.write(b"%x\r\n%s\r\n0\r\n\r\n" % (len(octets), octets) if self.is_chunked else octets)

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


@pytest.fixture
def site() -> Iterator[Site]:
    with Site().open() as found:
        yield found


@pytest.fixture(autouse=True)
def fetched(tmp_path: Path) -> None:
    """As the lock makes it."""
    (tmp_path / "fetched").mkdir()


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path, reserve=0)


def fetch(
    url: str,
    folder: Folder,
    seen: Callable[[int, int], None] = lambda have, size: None,
    clock: Callable[[], float] = lambda: 0.0,
) -> bytes:
    return update_fetch.from_url(url, folder, seen, MOST, lambda seconds: None, clock).read_bytes()


def piped(stream: BinaryIO, folder: Folder) -> bytes:
    return update_fetch.from_stream(stream, folder, lambda have, size: None, MOST).read_bytes()


def test_a_file_is_fetched_whole_and_how_far_it_is_is_told(site: Site, folder: Folder):
    seen: list[tuple[int, int]] = []
    assert fetch(site.url, folder, lambda have, size: seen.append((have, size))) == FILE
    assert seen[-1] == (len(FILE), len(FILE))
    assert not folder.part.exists()


def test_a_connection_that_breaks_off_again_and_again_is_gone_on_with_where_it_was(site: Site, folder: Folder):
    site.does.cuts += [100_000, 50_000, 1, 20_000]
    assert fetch(site.url, folder) == FILE
    assert [wanted for _, wanted in site.does.asked] == [
        None,
        "bytes=100000-",
        "bytes=150000-",
        "bytes=150001-",
        "bytes=170001-",
    ]


def test_a_server_without_ranges_is_begun_with_again(site: Site, folder: Folder):
    site.does.has_ranges = False
    site.does.cuts += [100_000]
    assert fetch(site.url, folder) == FILE


def test_a_file_that_has_changed_meanwhile_is_begun_with_again(site: Site, folder: Folder):
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": site.url, "tag": '"0"', "size": 400_000})
    assert fetch(site.url, folder) == FILE


def test_another_address_is_begun_with_again(site: Site, folder: Folder):
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": "http://elsewhere/update", "tag": '"1"', "size": 400_000})
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == [("/update", None)]


def test_the_next_run_goes_on_where_this_one_was_broken_off(site: Site, folder: Folder):
    site.does.cuts += [123_456, *[0] * 20]
    with pytest.raises(StationError, match=r"after 123456 of 300000 octets; 0\.1 MB of it had come"):
        fetch(site.url, folder)
    site.does.cuts.clear()
    site.does.asked.clear()
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == [("/update", "bytes=123456-")]


def test_a_run_that_ended_behind_the_last_octet_asks_for_nothing_more(site: Site, folder: Folder):
    folder.part.write_bytes(FILE)
    folder.note({"url": site.url, "tag": '"1"', "size": len(FILE)})
    assert fetch(site.url, folder) == FILE
    assert site.does.asked == []


def test_a_part_that_is_longer_than_the_file_is_begun_with_again(site: Site, folder: Folder):
    folder.part.write_bytes(FILE + b"more")
    folder.note({"url": site.url, "tag": '"1"', "size": 1_000_000})
    assert fetch(site.url, folder) == FILE


def test_a_server_that_does_not_say_how_long_it_is_is_read_to_its_end(site: Site, folder: Folder):
    site.does.has_length = False
    assert fetch(site.url, folder) == FILE


def test_the_rest_in_chunks_is_as_long_as_the_server_has_said(site: Site, folder: Folder):
    folder.part.write_bytes(FILE[:100_000])
    folder.note({"url": site.url, "tag": '"1"', "size": len(FILE)})
    site.does.is_chunked = True
    site.does.protocol_version = "HTTP/1.1"
    site.does.cuts += [50_000]
    assert fetch(site.url, folder) == FILE
    assert [wanted for _, wanted in site.does.asked] == ["bytes=100000-", "bytes=150000-"]


def test_the_room_of_a_part_that_is_begun_with_again_is_room(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    folder.part.write_bytes(b"old" * 1000)
    folder.note({"url": site.url, "tag": '"0"', "size": 400_000})
    monkeypatch.setattr(folder, "room", lambda: 0 if folder.part.exists() else len(FILE))
    assert fetch(site.url, folder) == FILE


@pytest.mark.parametrize("number", [errno.EROFS, errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("name", ["open", "fsync", "rename", "unlink"])
def test_a_card_that_takes_no_writes_is_told(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, name: str, number: int
):
    def refuse(*arguments: object, **named: object) -> None:
        raise OSError(number, words)

    words = os.strerror(number)
    if name == "fsync":
        monkeypatch.setattr("os.fsync", refuse)
    else:
        monkeypatch.setattr(Path, name, refuse)
    with pytest.raises(StorageError, match=words):
        fetch(site.url, folder)
    with pytest.raises(StorageError, match=words):
        piped(io.BytesIO(FILE), folder)


def test_a_pipe_that_cannot_be_read_is_told(folder: Folder):
    class Broken(io.BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            raise OSError(errno.EIO, "Input/output error")

    with pytest.raises(StationError, match="the input cannot be read: Input/output error"):
        piped(Broken(), folder)


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
def test_what_has_no_length_is_fetched_up_to_that_of_the_largest_bundle(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, is_chunked: bool
):
    site.does.has_length, site.does.is_chunked = False, is_chunked
    site.does.protocol_version = "HTTP/1.1"
    monkeypatch.setattr(f"{__name__}.MOST", len(FILE) - 1)
    with pytest.raises(StationError, match=r"is 0 MB or more, and a bundle for this box"):
        fetch(site.url, folder)
    assert list(folder.part.parent.iterdir()) == []
    monkeypatch.setattr(f"{__name__}.MOST", len(FILE))
    assert fetch(site.url, folder) == FILE


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


def test_it_goes_where_it_is_led_but_not_in_circles(site: Site, folder: Folder):
    assert fetch(f"{site.base}/to//update", folder) == FILE
    with pytest.raises(StationError, match="leads from address to address"):
        fetch(f"{site.base}/to//to//to//to//to//to//update", folder)


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (404, "the server has no such file"),
        (403, "the server forbids it"),
        (401, "wants a name and a password"),
        (418, "answers 418"),
        (503, "the server answers 503 Service Unavailable"),
    ],
)
def test_what_the_server_refuses_is_told(site: Site, folder: Folder, status: int, said: str):
    site.does.status = status
    with pytest.raises(StationError, match=said):
        fetch(site.url, folder)


def test_a_file_that_has_no_room_is_refused_before_any_of_it_is_written(site: Site, tmp_path: Path):
    folder = Folder(tmp_path, reserve=1 << 60)
    with pytest.raises(StationError, match="has room for 0 MB, and 0 MB are to come"):
        fetch(site.url, folder)
    assert not folder.part.exists()


def test_a_stream_without_an_end_stops_where_the_room_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = Folder(tmp_path, reserve=0)
    left = iter([200_000, 100_000, 50_000, 0, 0])
    monkeypatch.setattr(folder, "room", lambda: next(left))
    with pytest.raises(StationError, match="has room for 0 MB"):
        piped(io.BytesIO(bytes(10_000_000)), folder)


@pytest.mark.parametrize(
    "url", ["http://[::1", "http://[::1/x", "http://", "http://a:b/x", "http://my server/x", "https://a\x7fb/x"]
)
def test_what_is_no_address_is_told(folder: Folder, url: str):
    with pytest.raises(StationError, match=r"is no address|port"):
        fetch(url, folder)


@pytest.mark.parametrize(
    ("url", "host", "port"),
    [
        ("http://[2001:db8::7]/x", "2001:db8::7", 80),
        ("https://[2001:db8::7]/x", "2001:db8::7", 443),
        ("https://[2001:db8::7]:8443/x", "2001:db8::7", 8443),
        ("https://example.org/x", "example.org", 443),
    ],
)
def test_the_host_is_asked_at_its_port(folder: Folder, monkeypatch: pytest.MonkeyPatch, url: str, host: str, port: int):
    asked: list[tuple[str, int]] = []

    def refuse(address: tuple[str, int], *arguments: object) -> None:
        asked.append(address)
        raise ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused")

    monkeypatch.setattr("socket.create_connection", refuse)
    with pytest.raises(StationError, match="nobody listens there"):
        fetch(url, folder)
    assert asked == [(host, port)]


def test_a_server_that_leads_to_no_address_is_told(site: Site, folder: Folder):
    with pytest.raises(StationError, match=r"leads to 'http://\[::1/x', which is no address"):
        fetch(f"{site.base}/to/http://[::1/x", folder)
    with pytest.raises(StationError, match="http://my server/x: is no address"):
        fetch(f"{site.base}/to/http://my server/x", folder)


def test_a_length_that_no_file_has_is_none(site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(site.does, "length", "9" * 5000)
    assert fetch(site.url, folder) == FILE


def test_an_address_may_have_blanks_and_any_letters(site: Site, folder: Folder):
    assert fetch(f"{site.base}/new release/für alle?a=b c%20d", folder) == FILE
    assert site.does.asked[-1][0] == "/new%20release/f%C3%BCr%20alle?a=b%20c%20d"
    assert fetch(f"{site.base}/{os.fsdecode(b'caf%c' % 0xE9)}", folder) == FILE  # of a shell that is not UTF-8's
    assert site.does.asked[-1][0] == "/caf%E9"


@pytest.mark.parametrize(
    ("kind", "said"),
    [("text/html", "text/html"), ("Text/HTML; charset=utf-8", "text/html"), ("application/json", "application/json")],
)
def test_a_page_in_place_of_a_file_is_refused_by_its_address_before_any_of_it_is_kept(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, kind: str, said: str
):
    monkeypatch.setattr(site.does, "kind", kind)
    with pytest.raises(StationError) as told:
        fetch(site.url, folder)
    assert told.value.message == f"{site.url}: the server sends a page ({said}), and no bundle"
    assert "login" in told.value.hint
    assert not folder.part.exists()


def test_a_page_that_an_address_leads_to_is_told_with_where_it_is(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(site.does, "kind", "text/html")
    url = f"{site.base}/to//portal"
    with pytest.raises(StationError, match=f"^{url}: leads to {site.base}/portal, which sends a page"):
        fetch(url, folder)


@pytest.mark.parametrize("kind", ["text/plain", "application/octet-stream", "application/vnd.rauc"])
def test_a_file_is_taken_by_whatever_name_servers_have_for_it(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, kind: str
):
    monkeypatch.setattr(site.does, "kind", kind)
    assert fetch(site.url, folder) == FILE


def test_what_comes_by_a_pipe_is_taken_to_its_end(folder: Folder):
    folder.part.write_bytes(b"of another one")
    assert piped(io.BytesIO(FILE), folder) == FILE


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("http://127.0.0.1:9/update", "nobody listens there"),
        ("http:///update", "is no address of a file"),
        ("http://localhost:99999/update", "ort"),
    ],
)
def test_a_server_that_is_not_there_is_told_at_once(folder: Folder, url: str, said: str):
    with pytest.raises(StationError, match=said):
        fetch(url, folder)


@pytest.mark.parametrize(
    ("number", "said"),
    [(socket.EAI_NONAME, "there is no host of this name"), (socket.EAI_AGAIN, "no name server answers")],
)
def test_a_name_that_nobody_knows_is_told(folder: Folder, monkeypatch: pytest.MonkeyPatch, number: int, said: str):
    def unknown(*arguments: object, **named: object) -> None:
        raise socket.gaierror(number, "as the resolver says it")

    monkeypatch.setattr("socket.getaddrinfo", unknown)
    with pytest.raises(StationError, match=said):
        fetch("http://no.such.host.invalid/update", folder)


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Authority:
    return Authority(tmp_path_factory.mktemp("authority"))


@contextmanager
def secure(authority: Authority) -> Iterator[Site]:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    pair = authority.server()
    context.load_cert_chain(pair.certificate, pair.key)
    with Site(context).open() as found:
        yield found


def test_a_secure_server_is_one_of_a_known_authority(
    authority: Authority, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    with secure(authority) as site:
        with pytest.raises(StationError, match=r"authority that is not known here\n"):  # no key of an interface
            fetch(site.url, folder)
        monkeypatch.setenv("SSL_CERT_FILE", str(authority.certificate))
        assert fetch(site.url, folder) == FILE


def test_a_clock_that_was_never_set_is_named_where_a_certificate_is_not_valid_yet(monkeypatch: pytest.MonkeyPatch):
    error = ssl.SSLCertVerificationError(1, "x")
    error.verify_code, error.verify_message = 9, "certificate is not yet valid"
    monkeypatch.setattr(update_server, "is_clock_set", lambda: False)
    assert "the clock of this box was not set" in update_server._distrusted("https://x/y", error).message
    monkeypatch.setattr(update_server, "is_clock_set", lambda: True)
    assert "look at the clock" in update_server._distrusted("https://x/y", error).message


def test_two_updates_at_once_are_told(folder: Folder, tmp_path: Path):
    with (
        folder.locked(),
        pytest.raises(StationError, match="another update is running"),
        Folder(tmp_path).locked(),
    ):
        raise AssertionError("the second one has it too")
    with Folder(tmp_path).locked():
        assert json.loads('"both in turn"')


def test_a_folder_that_is_not_there_is_told(tmp_path: Path):
    with pytest.raises(StationError, match="no update can be prepared"), Folder(tmp_path / "none").locked():
        raise AssertionError("there is none")


def test_how_an_update_ended_is_kept_and_rubbish_in_its_place_is_none(folder: Folder):
    assert folder.last() == {}
    folder.tell("http://x/y", "1.2.3", "B", "installed")
    assert folder.last()["result"] == "installed"
    signed = f"https://x/y?signature={'a' * 8000}"
    folder.tell(signed, "1.2.3", "B", f"{signed}: the server forbids it")
    assert folder.last()["source"] == signed
    for octets in (b"", b"[]", b"\xff", b"{" * 100_000):
        (folder.place / "last.json").write_bytes(octets)
        assert folder.last() == {}
