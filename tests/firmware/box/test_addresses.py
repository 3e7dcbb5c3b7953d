"""What box.toml may say of addresses and names, which end up in files of the system's services."""

from pathlib import Path

import pytest

from board.errors import ConfigurationError
from firmware.box import box_file
from firmware.box.box_file import Ethernet, check_host_name, check_interface_address, check_server, check_time_zone


@pytest.mark.parametrize("text", ["192.168.1.20/24", "10.0.0.1/31", "2001:db8::7/64", "192.0.2.7/32", "fe80::7/64"])
def test_a_box_may_have_the_address_of_any_host(text: str):
    check_interface_address(text)


@pytest.mark.parametrize(
    "text",
    [
        "127.0.0.1/8", "::1/128", "224.0.0.1/24", "ff02::1/64", "0.0.0.0/24", "::/64", "255.255.255.255/32",
        "10.0.0.1/0", "2001:db8::1/0", "fe80::1%eth0/64", "fe80::1%eth0\n[Match]\nName=*/64",
    ],
)  # fmt: skip
def test_an_address_that_no_host_has_is_refused(text: str):
    with pytest.raises(ConfigurationError):
        check_interface_address(text)


@pytest.mark.parametrize("check", [check_server, box_file.check_plain_address])
@pytest.mark.parametrize(
    "text", ["fe80::1%a b", "fe80::1%eth0\nDHCP=yes", "2001:db8::1%1", "0.0.0.0", "ff02::1", "224.0.0.1"]
)
def test_a_zone_of_an_address_never_gets_into_a_file(check: object, text: str):
    with pytest.raises(ConfigurationError):
        check(text)  # type: ignore[operator]


@pytest.mark.parametrize("gateway", ["10.0.0.2", "10.0.0.255", "10.0.0.0", "10.0.1.1"])
def test_a_gateway_is_another_host_of_the_network(gateway: str):
    with pytest.raises(ConfigurationError, match="gateway"):
        Ethernet("10.0.0.2/24", gateway)


@pytest.mark.parametrize("name", ["localhost", "LocalHost", "10", "0x7f", "007"])
def test_a_name_that_means_an_address_is_no_host_name(name: str):
    with pytest.raises(ConfigurationError):
        check_host_name(name)


@pytest.mark.parametrize("text", ["localtime", "posixrules", "posix/Europe/Berlin", "right/UTC", "Factory", "../UTC"])
def test_what_lies_beside_the_zones_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str):
    (tmp_path / "zones" / text).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / "zones" / text).write_bytes(b"TZif2")
    monkeypatch.setattr("firmware.box.box_file.ZONES", tmp_path / "zones")
    with pytest.raises(ConfigurationError, match="is no time zone"):
        check_time_zone(text)


def test_a_time_zone_is_a_file_of_that_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(box_file, "ZONES", tmp_path)
    (tmp_path / "UTC").write_bytes(b"TZif2" + bytes(40))
    (tmp_path / "leapseconds").write_bytes(b"# Leap\t1972\n")
    check_time_zone("UTC")
    with pytest.raises(ConfigurationError):
        check_time_zone("leapseconds")


@pytest.mark.parametrize(
    ("address", "gateway"),
    [("10.0.0.1/31", "10.0.0.0"), ("10.0.0.0/31", "10.0.0.1"), ("2001:db8::/127", "2001:db8::1")],
)
def test_both_addresses_of_a_network_of_two_are_hosts(address: str, gateway: str):
    # RFC 3021; RFC 6164
    check_interface_address(address)
    assert Ethernet(address, gateway).gateway == gateway


@pytest.mark.parametrize(
    ("address", "gateway", "usual"),
    [("10.0.0.2/32", "10.0.0.1", "10.0.0.2/24"), ("2001:db8::7/128", "2001:db8::1", "2001:db8::7/64")],
)
def test_a_network_of_one_address_has_no_gateway(address: str, gateway: str, usual: str):
    with pytest.raises(ConfigurationError, match="which has one address") as refused:
        Ethernet(address, gateway)
    assert usual in refused.value.hint
