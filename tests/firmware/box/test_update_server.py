"""Web servers of every kind, and what is said of those that send no bundle."""

import errno
import itertools
import os
import socket
import ssl
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from board.errors import StationError
from firmware.box import update_trouble
from firmware.box.update_folder import Folder
from firmware.cli import main
from tests.broker.certificates import Authority
from tests.firmware.box.conftest import Said
from tests.firmware.box.rauc_service import Service
from tests.firmware.box.web_site import FILE, Site, fetch


def test_it_goes_where_it_is_led_but_not_in_circles(site: Site, folder: Folder):
    assert fetch(f"{site.base}/to//update", folder) == FILE
    with pytest.raises(StationError, match="leads from address to address"):
        fetch(f"{site.base}/to//to//to//to//to//to//update", folder)


def test_the_scheme_of_an_address_has_no_case(service: Service, bundle: str, site: Site, tmp_path: Path):
    url = site.url.replace("http://", "HtTp://")
    assert main(["update", url]) == 0
    assert site.does.asked == [("/update", None)]
    assert Folder(tmp_path / "update").last()["source"] == url


def test_a_secure_server_does_not_lead_to_one_that_is_not(
    authority: Authority, site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("SSL_CERT_FILE", str(authority.certificate))
    with secure(authority) as first:
        url = f"{first.base}/to/{site.url}".replace("https://", "HTTPS://")
        with pytest.raises(StationError) as told:
            fetch(url, folder)
    assert told.value.message == f"{url}: leads to {site.url}, which is not secure"
    assert site.does.asked == []


@pytest.mark.parametrize(
    ("status", "said", "hint"),
    [
        (404, "has no such file", "correct the address"),
        (410, "has no such file any more", "correct the address"),
        (403, "forbids it", "ask whoever runs the server, or copy the bundle here by ssh"),
        (401, "wants a name and a password, which this program does not send", "copy the bundle here by ssh"),
        (407, "wants a name and a password, which this program does not send", "copy the bundle here by ssh"),
        (408, "has waited too long for the request", "try it once more"),
        (429, "is asked too often", "wait some minutes and try it once more"),
        (418, "answers 418 I'm a Teapot", "ask whoever runs the server"),
        (304, "answers 304 Not Modified", "ask whoever runs the server"),
        (201, "sends no file (201 Created)", "correct the address"),
        (204, "sends no file (204 No Content)", "correct the address"),
        (503, "answers 503 Service Unavailable", "wait some minutes and try it once more"),
    ],
)
def test_what_the_server_refuses_is_told_with_what_to_do(site: Site, folder: Folder, status: int, said: str, hint: str):
    site.does.status = status
    with pytest.raises(StationError) as told:
        fetch(site.url, folder)
    assert (told.value.message, told.value.hint) == (f"{site.url}: the server {said}", hint)
    assert len(site.does.asked) == 1


@pytest.mark.parametrize("octets", [0, 1000])
def test_a_part_that_nobody_asked_for_is_no_file(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, octets: int
):
    monkeypatch.setattr(site.does, "always_begins", 1000)
    site.does.tag = ""
    folder.part.write_bytes(bytes(octets))
    folder.note({"url": site.url, "tag": "", "size": 0})
    with pytest.raises(StationError, match=f"^{site.url}: the server sends a part of the file, and was asked for all"):
        fetch(site.url, folder)
    assert list(folder.part.parent.iterdir()) == []


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (b"SSH-2.0-OpenSSH_9.2\r\n", "what answers there is no web server: it says 'SSH-2.0-OpenSSH_9.2'"),
        (b"HTTP/7.0 200 OK\r\n\r\n", "what answers there is no web server"),
        (b"HTTP/1.1 200 OK\r\n" + b"a: b\r\n" * 101 + b"\r\n", "what answers there is no web server"),
        (b"HTTP/1.1 200 OK\r\na: " + b"b" * 70_000 + b"\r\n\r\n", "what answers there is no web server"),
    ],
)
def test_what_is_no_web_server_is_told_without_a_name_of_python(folder: Folder, answer: bytes, said: str):
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def say() -> None:
            with listener.accept()[0] as end:
                end.recv(4096)
                end.sendall(answer)

        saying = threading.Thread(target=say)
        saying.start()
        url = f"http://127.0.0.1:{listener.getsockname()[1]}/x"
        with pytest.raises(StationError) as told:
            fetch(url, folder)
        saying.join()
    assert told.value.message.strip() == f"{url}: {said}"
    assert told.value.hint == "correct the address"


@pytest.mark.parametrize(
    ("error", "said", "hint"),
    [
        (OSError(errno.EHOSTUNREACH, "No route to host"), "no route to it", "is the network there? captain doctor"),
        (OSError(errno.ENETUNREACH, "x"), "no route to it", "is the network there? captain doctor"),
        (OSError(), "the connection has failed", "is the network there? captain doctor"),
        (socket.gaierror(socket.EAI_NONAME, "x"), "there is no host of this name", "correct the host in the address"),
        (socket.gaierror(socket.EAI_AGAIN, "x"), "no name server answers", "is the network there? captain doctor"),
        (TimeoutError("timed out"), "nothing came for 30 s", update_trouble.NOBODY),
    ],
)
def test_what_fails_is_told_with_one_remedy(
    folder: Folder, monkeypatch: pytest.MonkeyPatch, error: OSError, said: str, hint: str
):
    def fail(*arguments: object) -> None:
        raise error

    monkeypatch.setattr("socket.create_connection", fail)
    with pytest.raises(StationError) as told:
        fetch("http://host/x", folder)
    assert (told.value.message, told.value.hint) == (f"http://host/x: {said}", hint)


@pytest.mark.parametrize("url", ["http://[::1", "http://[::1/x", "http://", "http://my server/x", "https://a\x7fb/x"])
def test_what_is_no_address_is_told(folder: Folder, url: str):
    with pytest.raises(StationError, match=r"is no address of a file"):
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
    for where in (
        "http://[::1/x", "http://my server/x", "file:///etc/passwd", "ftp://host/x", "javascript:alert(1)", "https://",
    ):  # fmt: skip
        url = f"{site.base}/to/{where}"
        with pytest.raises(StationError) as told:
            fetch(url, folder)
        assert told.value.message == f"{url}: leads to {where}, which is no address of a file"
        assert told.value.hint == "ask whoever runs the server"


def test_a_server_that_leads_to_a_port_that_there_is_not_is_told(site: Site, folder: Folder):
    url = f"{site.base}/to/http://host:99999/x"
    with pytest.raises(StationError) as told:
        fetch(url, folder)
    assert told.value.message == f"{url}: leads to http://host:99999/x, where there is no port 99999"
    assert told.value.hint == "ask whoever runs the server"


def test_what_fails_where_a_server_has_led_to_is_told_of_the_address_that_was_typed(
    site: Site, folder: Folder, authority: Authority
):
    with secure(authority) as second:
        url = f"{site.base}/to/{second.url}"
        with pytest.raises(StationError) as told:
            fetch(url, folder)
    assert told.value.message.startswith(f"{url}: leads to {second.url}: its certificate is signed by")
    site.does.leads = "http://127.0.0.1:9/x"
    with pytest.raises(StationError) as told:
        fetch(url, folder)
    assert told.value.message == f"{url}: leads to {site.does.leads}: refuses the connection; nobody listens there"


SECRETS = [
    "http://user:SECRET@host/x", "HTTPS://SECRET@host/x", "http://user:SECRET@[::1/x", "ftp://user:SECRET@host/x",
    "http://user:SECRET/1@host/x", "http://user:80:SECRET/@host/x", "http://user:SECRET?1#@host/x", "http://:SECRET@host:99999/x",
]  # fmt: skip


@pytest.mark.parametrize("url", SECRETS)
@pytest.mark.parametrize("words", [[], ["--look"]])
def test_an_address_with_a_password_is_refused_and_the_password_is_nowhere(
    service: Service, said: Said, tmp_path: Path, url: str, words: list[str]
):
    assert main(["update", *words, url]) == 1
    assert said() == ("", "captain: a name and a password in an address are not sent\n  (leave them out)\n")
    assert list((tmp_path / "update").iterdir()) == []


@pytest.mark.parametrize("secret", [*SECRETS, "//user:SECRET@host/x"])
def test_a_server_that_leads_to_an_address_with_a_password_is_told_without_it(
    service: Service, said: Said, site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, secret: str
):
    monkeypatch.setattr(site.does, "leads", secret)
    url = f"{site.base}/to/it"
    assert main(["update", url]) == 1
    message = f"{url}: leads to an address with a name and a password, which are not sent"
    assert said() == ("", f"captain: {message}\n  (ask whoever runs the server)\n")
    assert Folder(tmp_path / "update").last()["result"] == f"{message} (ask whoever runs the server)"


@pytest.mark.parametrize("path", ["a@b", "a:b@c", "to//update?mail=a:b@c", "x#a:b@c"])
def test_a_path_may_have_what_stands_between_a_password_and_a_host(site: Site, folder: Folder, path: str):
    assert fetch(f"{site.base}/{path}", folder) == FILE


def test_a_server_that_leads_nowhere_is_told(site: Site, folder: Folder):
    with pytest.raises(StationError, match=f"^{site.base}/to/: the server answers 302 Found, and not where to"):
        fetch(f"{site.base}/to/", folder)
    assert len(site.does.asked) == 1


@pytest.mark.parametrize(
    "url", [f"http://{'a' * 64}.example/x", "http://.example/x", "http://a..b/x", "http://\u00ad\u00ad/x"]
)
def test_a_host_that_no_name_server_can_be_asked_for_is_no_address(folder: Folder, url: str):
    with pytest.raises(StationError) as told:
        fetch(url, folder)
    assert told.value.message == f"{url}: is no address of a file"


@pytest.mark.parametrize("port", ["0", "65536", "99999", "x", "-1"])
def test_a_port_that_there_is_not_is_told(folder: Folder, port: str):
    url = f"http://localhost:{port}/update"
    with pytest.raises(StationError) as told:
        fetch(url, folder)
    assert (told.value.message, told.value.hint) == (f"{url}: there is no port {port}", "one of 1 to 65535")


def test_an_empty_file_is_told_by_its_address_and_not_kept(site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(site.does, "length", "0")
    with pytest.raises(StationError, match=f"^{site.url}: the server sends an empty file"):
        fetch(site.url, folder)
    assert list(folder.part.parent.iterdir()) == []


def test_a_server_that_says_no_length_and_sends_nothing_is_told(site: Site, folder: Folder):
    site.does.has_length = False
    site.does.cuts += [0]
    with pytest.raises(StationError, match="has ended the connection before the first octet"):
        fetch(site.url, folder)


@pytest.mark.parametrize(("coding", "is_file"), [("gzip", False), ("BR", False), ("identity", True)])
def test_a_file_that_is_packed_on_the_way_is_refused(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, coding: str, is_file: bool
):
    monkeypatch.setattr(site.does, "coding", coding)
    if is_file:
        assert fetch(site.url, folder) == FILE
        return
    with pytest.raises(StationError, match=rf"^{site.url}: the server packs the file \({coding.lower()}\)"):
        fetch(site.url, folder)


@pytest.mark.parametrize(
    ("coding", "is_file"),
    [("gzip, chunked", False), ("gzip", False), ("chunked, chunked", False), ("Chunked", True), ("identity", True)],
)
def test_a_file_that_is_packed_for_the_way_is_refused(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, coding: str, is_file: bool
):
    monkeypatch.setattr(site.does, "transfer", coding)
    site.does.is_chunked = "chunked" in coding.lower()
    monkeypatch.setattr(site.does, "protocol_version", "HTTP/1.1")
    if is_file:
        assert fetch(site.url, folder) == FILE
        return
    with pytest.raises(StationError) as told:
        fetch(site.url, folder)
    assert told.value.message == f"{site.url}: the server packs the file ({coding})"
    assert list(folder.part.parent.iterdir()) == []


@pytest.mark.parametrize("has_part", [False, True])
def test_parts_in_place_of_a_file_are_refused(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, has_part: bool
):
    if has_part:
        folder.part.write_bytes(FILE[:1000])
        folder.note({"url": site.url, "tag": '"1"', "size": len(FILE)})
    monkeypatch.setattr(site.does, "kind", "Multipart/ByteRanges; boundary=x")
    with pytest.raises(StationError) as told:
        fetch(site.url, folder)
    assert told.value.message == f"{site.url}: the server sends parts (multipart/byteranges), and no bundle"
    assert told.value.hint == "ask whoever runs the server to send it as it is"
    assert folder.part.exists() is has_part


def test_a_server_without_tls_is_told_as_one(site: Site, folder: Folder):
    url = site.url.replace("http://", "https://")
    with pytest.raises(StationError) as told:
        fetch(url, folder)
    assert told.value.message == f"{url}: what answers there does not speak TLS"
    assert told.value.hint.startswith("is it an address with http://")


@pytest.mark.parametrize("error", [ssl.SSLEOFError(8, "EOF occurred"), ssl.SSLZeroReturnError(6, "closed")])
def test_a_connection_that_ends_while_tls_begins_is_gone_on_with(
    authority: Authority, folder: Folder, monkeypatch: pytest.MonkeyPatch, error: ssl.SSLError
):
    calls = itertools.count(1)
    wrap = ssl.SSLContext.wrap_socket

    def wrapped(context: ssl.SSLContext, *arguments: Any, **named: Any) -> ssl.SSLSocket:
        if named.get("server_hostname") and next(calls) == 2:
            raise error
        return wrap(context, *arguments, **named)

    monkeypatch.setattr(ssl.SSLContext, "wrap_socket", wrapped)
    monkeypatch.setenv("SSL_CERT_FILE", str(authority.certificate))
    with secure(authority) as site:
        site.does.cuts += [1000]
        assert fetch(site.url, folder) == FILE
        assert [wanted for _, wanted in site.does.asked] == [None, "bytes=1000-"]


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


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("kind", "text/html", "sends a page"),
        ("kind", "multipart/byteranges", "sends parts"),
        ("coding", "gzip", "packs the file"),
        ("length", "0", "sends an empty file"),
        ("status", 404, "has no such file"),
        ("status", 503, "answers 503"),
    ],
)
def test_what_is_no_file_where_an_address_leads_to_is_told_with_where_it_is(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, name: str, value: object, said: str
):
    monkeypatch.setattr(site.does, name, value)
    url = f"{site.base}/to//there"
    with pytest.raises(StationError, match=f"^{url}: leads to {site.base}/there, which {said}"):
        fetch(url, folder)


@pytest.mark.parametrize("kind", ["text/plain", "application/octet-stream", "application/vnd.rauc"])
def test_a_file_is_taken_by_whatever_name_servers_have_for_it(
    site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch, kind: str
):
    monkeypatch.setattr(site.does, "kind", kind)
    assert fetch(site.url, folder) == FILE


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("http://127.0.0.1:9/update", "nobody listens there"),
        ("http:///update", "is no address of a file"),
    ],
)
def test_a_server_that_is_not_there_is_told_at_once(folder: Folder, url: str, said: str):
    with pytest.raises(StationError, match=said):
        fetch(url, folder)


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
    monkeypatch.setattr(update_trouble, "is_clock_set", lambda: False)
    assert "the clock of this box was not set" in update_trouble.trouble(error, 30.0).words
    monkeypatch.setattr(update_trouble, "is_clock_set", lambda: True)
    assert "look at the clock" in update_trouble.trouble(error, 30.0).hint
