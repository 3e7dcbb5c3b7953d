"""Web servers of every kind, and what is said of those that send no bundle."""

import errno
import itertools
import socket
import ssl
import threading
from typing import Any

import pytest

from board.runtime.errors import StationError
from firmware.update import trouble
from firmware.update.folder import Folder
from firmware.update.server import LATER
from firmware.update.trouble import ASK, NOBODY
from tests.broker.certificates import Authority
from tests.firmware.update.web_site import FILE, Site, fetch, secure

NET, LOGIN, HOST, TIME = "captain doctor", "login", "correct the host", "captain time"
# What the server does, what is named of it, what is to be done.
REFUSED: list[tuple[dict[str, object], str, str]] = [
    ({"status": 401}, "name and password", "by ssh"),
    ({"status": 403}, "forbids", "by ssh"),
    ({"status": 404}, "no such file", "correct the address"),
    ({"status": 429}, "too many requests", LATER),
    *(({"status": status}, f" {status} ", ASK) for status in (201, 204, 304, 407, 408, 410, 418)),
    ({"status": 503}, " 503 ", LATER),
    ({"always_begins": 1000}, " 206 ", ASK),
    ({"kind": "text/html"}, "(text/html)", LOGIN),
    ({"kind": "Text/HTML; charset=utf-8"}, "(text/html)", LOGIN),
    ({"kind": "application/json"}, "(application/json)", LOGIN),
    ({"kind": "Multipart/ByteRanges; boundary=x"}, "(multipart/byteranges)", LOGIN),
    ({"has_length": False, "cuts": (0,)}, " 0 octets", NOBODY),
    ({"length": "0"}, " 0 octets", NOBODY),
]


@pytest.mark.parametrize("is_led", [False, True])
@pytest.mark.parametrize(("does", "value", "hint"), REFUSED)
def test_server_that_sends_no_file_is_told_once_with_what_to_do(
    site: Site, folder: Folder, does: dict[str, object], value: str, hint: str, is_led: bool
):
    for name, content in does.items():
        setattr(site.does, name, [*content] if isinstance(content, tuple) else content)
    url = f"{site.base}/to//update" if is_led else site.url
    with pytest.raises(StationError) as told:
        fetch(url, folder)
    assert told.value.message.startswith(f"{url}: ")
    assert value in told.value.message
    assert hint in told.value.hint
    assert "octets" in value or (f"redirects to {site.url}, which" in told.value.message) is is_led
    assert len(site.does.asked) == 1 + is_led
    assert list(folder.part.parent.glob("bundle.*")) in ([], [folder.part.with_suffix(".json")])


@pytest.mark.parametrize("does", [{"kind": "text/html"}, {"status": 404}])
def test_part_of_a_server_that_sends_no_file_now_is_kept(site: Site, folder: Folder, does: dict[str, object]):
    folder.part.write_bytes(FILE[:1000])
    folder.note({"url": site.url, "tag": '"1"', "size": len(FILE)})
    for name, content in does.items():
        setattr(site.does, name, content)
    with pytest.raises(StationError):
        fetch(site.url, folder)
    assert folder.part.exists()


@pytest.mark.parametrize("octets", [0, 1000])
def test_rest_that_was_not_asked_for_is_not_joined_to_a_part(site: Site, folder: Folder, octets: int):
    site.does.always_begins, site.does.tag = 1000, ""
    folder.part.write_bytes(bytes(octets))
    folder.note({"url": site.url, "tag": "", "size": 0})
    with pytest.raises(StationError, match=" 206 "):
        fetch(site.url, folder)
    assert list(folder.part.parent.iterdir()) == []


@pytest.mark.parametrize(
    "answer",
    [
        b"SSH-2.0-OpenSSH_9.2\r\n",
        b"HTTP/7.0 200 OK\r\n\r\n",
        b"HTTP/1.1 200 OK\r\n" + b"a: b\r\n" * 101 + b"\r\n",
        b"HTTP/1.1 200 OK\r\na: " + b"b" * 70_000 + b"\r\n\r\n",
    ],
)
def test_answer_of_no_web_server_is_told_by_its_address(folder: Folder, answer: bytes):
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
    assert told.value.message == f"{url}: this is not a web server"


CLOSED = "closed the connection"


@pytest.mark.parametrize(
    ("error", "value", "hint"),
    [
        (
            ConnectionRefusedError(errno.ECONNREFUSED, "x"),
            "refuses the connection",
            NOBODY,
        ),  # as the update proof has it
        (ConnectionResetError(errno.ECONNRESET, "x"), CLOSED, NOBODY),
        (BrokenPipeError(errno.EPIPE, "x"), CLOSED, NOBODY),
        (OSError(errno.EHOSTUNREACH, "No route to host"), "No route to host", NET),
        (OSError(), "the connection failed", NET),
        (socket.gaierror(socket.EAI_NONAME, "not known"), "not known", HOST),
        (socket.gaierror(socket.EAI_NODATA, "no address"), "no address", HOST),
        (socket.gaierror(socket.EAI_FAIL, "non-recoverable failure"), "non-recoverable failure", NET),
        (socket.gaierror(socket.EAI_AGAIN, "failure in name resolution"), "failure in name resolution", NET),
        (TimeoutError("timed out"), " 30 s", NOBODY),
    ],
)
def test_connection_that_fails_is_told_with_one_remedy(
    folder: Folder, monkeypatch: pytest.MonkeyPatch, error: OSError, value: str, hint: str
):
    def fail(*arguments: object) -> None:
        raise error

    monkeypatch.setattr("socket.create_connection", fail)
    with pytest.raises(StationError) as told:
        fetch("http://host/x", folder)
    assert told.value.message.startswith("http://host/x: ")
    assert value in told.value.message
    assert hint in told.value.hint


@pytest.mark.parametrize("error", [ssl.SSLEOFError(8, "EOF occurred"), ssl.SSLZeroReturnError(6, "closed")])
def test_connection_that_ends_while_tls_begins_is_gone_on_with(
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
    "does",
    [
        {"kind": "text/plain"},
        {"kind": "application/octet-stream"},
        {"kind": "application/vnd.rauc"},
        {"coding": "identity"},
        {"transfer": "identity"},
        {"transfer": "Chunked", "is_chunked": True, "protocol_version": "HTTP/1.1"},
        {"length": "9" * 5000},
        {"has_length": False},
    ],
)
def test_file_is_taken_whatever_its_server_calls_it(site: Site, folder: Folder, does: dict[str, object]):
    for name, content in does.items():
        setattr(site.does, name, content)
    assert fetch(site.url, folder) == FILE


def test_secure_server_is_one_of_a_known_authority(
    authority: Authority, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    with secure(authority) as site:
        # The words are those of the update proof; no key of an interface is named.
        with pytest.raises(StationError, match=r"unknown authority\n"):
            fetch(site.url, folder)
        monkeypatch.setenv("SSL_CERT_FILE", str(authority.certificate))
        assert fetch(site.url, folder) == FILE


def test_server_without_tls_is_told_at_a_secure_address(site: Site, folder: Folder):
    url = site.url.replace("http://", "https://")
    with pytest.raises(StationError) as told:
        fetch(url, folder)
    assert told.value.message.startswith(f"{url}: TLS ")
    assert "http://" in told.value.hint


def test_server_of_another_host_is_told_to_correct_the_host(
    authority: Authority, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("SSL_CERT_FILE", str(authority.certificate))
    with secure(authority, ["DNS:other.example"]) as site, pytest.raises(StationError) as told:
        fetch(site.url, folder)
    assert told.value.message.startswith(f"{site.url}: ")
    assert HOST in told.value.hint


def test_chunked_answer_that_is_cut_off_is_no_other_server(site: Site, folder: Folder):
    site.does.is_chunked, site.does.protocol_version = True, "HTTP/1.1"
    site.does.ends_early = True
    with pytest.raises(StationError, match=rf"^{site.url}: {CLOSED}; 0\.3 MB"):
        fetch(site.url, folder)


# Codes: openssl/x509_vfy.h.
@pytest.mark.parametrize(
    ("code", "is_clock_set", "value", "hint"),
    [
        (9, False, "this box", TIME),
        (9, True, "x", TIME),
        (10, True, "x", TIME),
        (18, True, "unknown authority", "the image"),
        (62, True, "x", HOST),
        (64, True, "x", HOST),
    ],
)
def test_certificate_that_is_refused_has_openssls_words_or_the_clocks(
    monkeypatch: pytest.MonkeyPatch, code: int, is_clock_set: bool, value: str, hint: str
):
    error = ssl.SSLCertVerificationError(1, "y")
    error.verify_code, error.verify_message = code, "x"
    monkeypatch.setattr(trouble, "is_clock_set", lambda: is_clock_set)
    told = trouble.trouble(error, 30.0)
    assert value in told.words
    assert hint in told.hint


@pytest.mark.parametrize(
    ("reason", "hint"), [("WRONG_VERSION_NUMBER", "http://"), ("RECORD_LAYER_FAILURE", "http://"), ("NO_CIPHERS", ASK)]
)
def test_tls_that_fails_has_openssls_words_and_a_remedy(reason: str, hint: str):
    error = ssl.SSLError(1, "y")
    error.reason = reason
    told = trouble.trouble(error, 30.0)
    assert told.words == f"TLS fails: {reason.replace('_', ' ').lower()}"
    assert hint in told.hint
