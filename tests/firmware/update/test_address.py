"""Addresses of a bundle, and where a server may lead to from there."""

import errno
import os
from pathlib import Path

import pytest

from board.runtime.errors import StationError
from firmware.cli import main
from firmware.update.folder import Folder
from firmware.update.trouble import ASK
from tests.broker.certificates import Authority
from tests.firmware.update.conftest import Said
from tests.firmware.update.rauc_service import Service
from tests.firmware.update.web_site import FILE, Site, fetch, secure

NONE = [
    "http://[::1", "http://[::1/x", "http://", "http:///x", "http://my server/x", "https://a\x7fb/x",
    "http://host:0/x", "http://host:65536/x", "http://host:99999/x", "http://host:x/x", "http://host:-1/x",
    # that no name server can be asked for
    f"http://{'a' * 64}.example/x", "http://.example/x", "http://a..b/x", "http://\u00ad\u00ad/x",
]  # fmt: skip
ELSEWHERE = ["file:///etc/passwd", "ftp://host/x", "javascript:alert(1)", "https://"]


@pytest.mark.parametrize("url", NONE)
def test_text_that_is_no_address_is_told(folder: Folder, url: str):
    with pytest.raises(StationError) as told:
        fetch(url, folder)
    assert told.value.message.startswith(f"{url}: ")
    assert "https://HOST[:PORT]/PATH" in told.value.hint


@pytest.mark.parametrize("where", [NONE[1], NONE[4], NONE[8], *ELSEWHERE])
def test_server_that_leads_to_no_address_is_told(site: Site, folder: Folder, where: str):
    url = f"{site.base}/to/{where}"
    with pytest.raises(StationError) as told:
        fetch(url, folder)
    assert told.value.message.startswith(f"{url}: redirects to {where}, which")
    assert told.value.hint == ASK


@pytest.mark.parametrize("path", ["/to//to//to//to//to//to//update", "/to/"])
def test_server_that_leads_in_circles_or_nowhere_is_asked_five_times(site: Site, folder: Folder, path: str):
    with pytest.raises(StationError) as told:
        fetch(f"{site.base}{path}", folder)
    assert (told.value.message.startswith(f"{site.base}{path}: "), told.value.hint) == (True, ASK)
    assert len(site.does.asked) == 5


@pytest.mark.parametrize(
    ("path", "asked"),
    [
        ("to//update", "/update"),
        ("to//to//to//to//update", "/update"),
        # what stands between a password and a host
        ("a@b", "/a@b"),
        ("a:b@c", "/a:b@c"),
        ("to//update?mail=a:b@c", "/to//update?mail=a:b@c"),
        ("x#a:b@c", "/x"),
        # blanks and any letters; the last one of a shell that is not UTF-8's
        ("new release/für alle?a=b c%20d", "/new%20release/f%C3%BCr%20alle?a=b%20c%20d"),
        (os.fsdecode(b"caf%c" % 0xE9), "/caf%E9"),
    ],
)
def test_path_of_any_letters_is_asked_for(site: Site, folder: Folder, path: str, asked: str):
    assert fetch(f"{site.base}/{path}", folder) == FILE
    assert asked in [each for each, _ in site.does.asked]


@pytest.mark.parametrize(
    ("url", "host", "port"),
    [
        ("http://[2001:db8::7]/x", "2001:db8::7", 80),
        ("https://[2001:db8::7]/x", "2001:db8::7", 443),
        ("https://[2001:db8::7]:8443/x", "2001:db8::7", 8443),
        ("https://example.org/x", "example.org", 443),
    ],
)
def test_host_of_an_address_is_asked_at_its_port(
    folder: Folder, monkeypatch: pytest.MonkeyPatch, url: str, host: str, port: int
):
    asked: list[tuple[str, int]] = []

    def refuse(address: tuple[str, int], *arguments: object) -> None:
        asked.append(address)
        raise ConnectionRefusedError(errno.ECONNREFUSED, "Connection refused")

    monkeypatch.setattr("socket.create_connection", refuse)
    with pytest.raises(StationError):
        fetch(url, folder)
    assert asked == [(host, port)]


def test_scheme_of_an_address_has_no_case(service: Service, bundle: str, site: Site, tmp_path: Path):
    url = site.url.replace("http://", "HtTp://")
    assert main(["update", url]) == 0
    assert site.does.asked == [("/update", None)]
    assert Folder(tmp_path / "update").last()["source"] == url


def test_secure_server_that_leads_to_one_that_is_not_is_refused(
    authority: Authority, site: Site, folder: Folder, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("SSL_CERT_FILE", str(authority.certificate))
    with secure(authority) as first:
        url = f"{first.base}/to/{site.url}".replace("https://", "HTTPS://")
        with pytest.raises(StationError) as told:
            fetch(url, folder)
    assert told.value.message == f"{url}: redirects to {site.url}, which is not secure"
    assert site.does.asked == []


def test_failure_where_a_server_has_led_to_is_told_of_both_addresses(site: Site, folder: Folder, authority: Authority):
    with secure(authority) as second:
        for where in (second.url, "http://127.0.0.1:9/x"):
            url = f"{site.base}/to/{where}"
            with pytest.raises(StationError) as told:
                fetch(url, folder)
            assert told.value.message.startswith(f"{url}: redirects to {where}: ")


SECRETS = [
    "http://user:SECRET@host/x", "HTTPS://SECRET@host/x", "http://user:SECRET@[::1/x", "ftp://user:SECRET@host/x",
    "http://user:SECRET/1@host/x", "http://user:80:SECRET/@host/x", "http://user:SECRET?1#@host/x",
    "http://:SECRET@host:99999/x",
]  # fmt: skip


@pytest.mark.parametrize("url", SECRETS)
@pytest.mark.parametrize("words", [[], ["--look"]])
def test_address_with_a_password_is_refused_and_told_nowhere(
    service: Service, said: Said, tmp_path: Path, url: str, words: list[str]
):
    assert main(["update", *words, url]) == 1
    out, err = said()
    assert (out, err.count("captain: "), "SECRET" in err) == ("", 1, False)
    assert list((tmp_path / "update").iterdir()) == []


@pytest.mark.parametrize("secret", [*SECRETS, "//user:SECRET@host/x"])
def test_server_that_leads_to_a_password_is_told_without_it(
    service: Service, said: Said, site: Site, tmp_path: Path, secret: str
):
    site.does.leads = secret
    url = f"{site.base}/to/it"
    assert main(["update", url]) == 1
    out, err = said()
    assert (out, err.startswith(f"captain: {url}: redirects to "), "SECRET" in err) == ("", True, False)
    result = str(Folder(tmp_path / "update").last()["result"])
    assert (result.startswith(f"{url}: redirects to "), "SECRET" in result) == (True, False)
