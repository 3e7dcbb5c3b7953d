"""Addresses, names and time zones of box.toml, which end up in files of the system's services."""

from collections.abc import Callable
from pathlib import Path

import pytest

from board.runtime.errors import ConfigurationError
from firmware.card import box_file
from firmware.card.box_file import (
    Ethernet,
    check_country,
    check_host_name,
    check_interface_address,
    check_plain_address,
    check_server,
    check_time_zone,
)

Check = Callable[[str], None]
ZONED = ["fe80::1%a b", "fe80::1%eth0\nDHCP=yes", "2001:db8::1%1", "0.0.0.0", "ff02::1", "224.0.0.1", "255.255.255.255"]
REFUSED: list[tuple[Check, list[str]]] = [
    (
        check_interface_address,
        ["127.0.0.1/8", "::1/128", "224.0.0.1/24", "ff02::1/64", "0.0.0.0/24", "::/64", "255.255.255.255/32", "10.0.0.1/0",
         "2001:db8::1/0", "fe80::1%eth0/64", "fe80::1%eth0\n[Match]\nName=*/64", "10.0.0.255/24", "10.0.0.1"],
    ),
    (check_plain_address, [*ZONED, "10.0.0", "x"]),
    (check_server, [*ZONED, "", "a b", "x iburst\nserver y", "-a.de", "a..b", "192.0.2", "192.0.2.256", "fe80::x", "a." * 140, "a_b"]),
    (check_host_name, ["localhost", "LocalHost", "10", "0x7f", "007", "", "a-", 64 * "a"]),
    (check_country, ["D", "GER", "d1", "xx"]),
]  # fmt: skip
TAKEN: list[tuple[Check, list[str]]] = [
    (check_interface_address, ["192.168.1.20/24", "10.0.0.1/31", "2001:db8::7/64", "192.0.2.7/32", "fe80::7/64"]),
    (check_server, ["ptbtime1.ptb.de", "ntp", "192.0.2.1", "2001:db8::1", "a.b.c."]),
    (check_host_name, ["captain-7", "x", 63 * "a", "7-up"]),
    (check_country, ["DE", "GB", "US"]),
]


@pytest.mark.parametrize(("check", "text"), [(check, text) for check, texts in REFUSED for text in texts])
def test_text_that_no_file_of_the_system_may_have_is_refused(check: Check, text: str):
    with pytest.raises(ConfigurationError):
        check(text)


@pytest.mark.parametrize(("check", "text"), [(check, text) for check, texts in TAKEN for text in texts])
def test_text_that_a_box_may_have_is_taken(check: Check, text: str):
    check(text)


@pytest.mark.parametrize(
    ("address", "gateway", "is_one"),
    [
        ("10.0.0.2/24", "10.0.0.1", True),
        ("10.0.0.2/24", "10.0.0.2", False),
        ("10.0.0.2/24", "10.0.0.255", False),
        ("10.0.0.2/24", "10.0.0.0", False),
        ("10.0.0.2/24", "10.0.1.1", False),
        ("10.0.0.2/24", "fe80::1", False),
        ("2001:db8::7/64", "fe80::1", True),
        # networks of two; RFC 3021, RFC 6164
        ("10.0.0.1/31", "10.0.0.0", True),
        ("10.0.0.0/31", "10.0.0.1", True),
        ("2001:db8::/127", "2001:db8::1", True),
        # networks of one
        ("10.0.0.2/32", "10.0.0.1", False),
        ("2001:db8::7/128", "2001:db8::1", False),
    ],
)
def test_gateway_is_another_host_of_the_network(address: str, gateway: str, is_one: bool):
    check_interface_address(address)
    if is_one:
        assert Ethernet(address, gateway).gateway == gateway
        return
    with pytest.raises(ConfigurationError, match=r"^gateway: ") as refused:
        Ethernet(address, gateway)
    assert gateway in refused.value.message


@pytest.mark.parametrize(("address", "usual"), [("10.0.0.2/32", "10.0.0.2/24"), ("2001:db8::7/128", "2001:db8::7/64")])
def test_gateway_of_a_network_of_one_is_refused_with_the_usual_length(address: str, usual: str):
    with pytest.raises(ConfigurationError) as refused:
        Ethernet(address, "192.0.2.1")
    assert usual in refused.value.hint


@pytest.mark.parametrize("has_table", [True, False])
def test_country_without_a_table_is_known_by_its_form(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_table: bool):
    if has_table:
        (tmp_path / "table").write_text("# x\nDE\tGermany\n")
    monkeypatch.setattr(box_file, "TABLE", tmp_path / "table")
    check_country("DE")
    if not has_table:
        check_country("XX")
        return
    with pytest.raises(ConfigurationError):
        check_country("XX")


@pytest.mark.parametrize(
    ("text", "octets", "is_zone"),
    [
        ("UTC", b"TZif2", True),
        ("Europe/Berlin", b"TZif2", True),
        ("leapseconds", b"# Leap\t1972\n", False),
        *((text, b"TZif2", False) for text in ("localtime", "posixrules", "posix/Europe/Berlin", "right/UTC", "Factory", "../UTC")),
        ("None", None, False),
    ],
)  # fmt: skip
def test_time_zone_is_a_file_of_that_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, octets: bytes | None, is_zone: bool
):
    monkeypatch.setattr(box_file, "ZONES", tmp_path / "zones")
    check_time_zone("Europe/Berlin")  # of a computer without zones: it has the form of one
    (tmp_path / "zones").mkdir()
    if octets is not None:
        (tmp_path / "zones" / text).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "zones" / text).write_bytes(octets)
    if is_zone:
        check_time_zone(text)
        return
    with pytest.raises(ConfigurationError) as refused:
        check_time_zone(text)
    assert text in refused.value.message
