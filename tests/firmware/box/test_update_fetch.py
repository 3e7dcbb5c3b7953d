"""Bundles from web servers of every kind, broken off and gone on with."""

import errno
import io
import json
import os
import socket
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from board.errors import StationError, StorageError
from firmware.box import update_server
from firmware.box.update_folder import Folder
from tests.broker.certificates import Authority
from tests.firmware.box.web_site import FILE, Site, fetch, piped


@pytest.fixture(autouse=True)
def fetched(tmp_path: Path) -> None:
    """As the lock makes it."""
    (tmp_path / "fetched").mkdir(exist_ok=True)


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
