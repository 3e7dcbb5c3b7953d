"""What is an address of a bundle, and where a server may lead to from there."""

import errno
import os
from pathlib import Path

import pytest

from board.errors import StationError
from firmware.box.update_folder import Folder
from firmware.cli import main
from tests.broker.certificates import Authority
from tests.firmware.box.conftest import Said
from tests.firmware.box.rauc_service import Service
from tests.firmware.box.web_site import FILE, Site, fetch, secure


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
    "http://user:SECRET/1@host/x", "http://user:80:SECRET/@host/x", "http://user:SECRET?1#@host/x",
    "http://:SECRET@host:99999/x",
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


def test_an_address_may_have_blanks_and_any_letters(site: Site, folder: Folder):
    assert fetch(f"{site.base}/new release/für alle?a=b c%20d", folder) == FILE
    assert site.does.asked[-1][0] == "/new%20release/f%C3%BCr%20alle?a=b%20c%20d"
    assert fetch(f"{site.base}/{os.fsdecode(b'caf%c' % 0xE9)}", folder) == FILE  # of a shell that is not UTF-8's
    assert site.does.asked[-1][0] == "/caf%E9"


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
