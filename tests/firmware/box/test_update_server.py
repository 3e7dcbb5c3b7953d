"""Web servers of every kind, and what is said of those that send no bundle."""

import errno
import itertools
import socket
import ssl
import threading
from typing import Any

import pytest

from board.errors import StationError
from firmware.box import update_trouble
from firmware.box.update_folder import Folder
from tests.broker.certificates import Authority
from tests.firmware.box.web_site import FILE, Site, fetch, secure


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
