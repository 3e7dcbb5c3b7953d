"""Addresses as people write them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.runtime.address import Address, address, check_device_name, host_and_port, mac_address
from board.runtime.errors import ConfigurationError

MACS = st.binary(min_size=6, max_size=6).filter(lambda octets: any(octets) and not octets[0] & 1)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ("", "")),
        ("station", ("station", "")),
        ("station:5555", ("station", "5555")),
        (":5555", ("", "5555")),
        ("::1", ("::1", "")),
        ("[::1]", ("::1", "")),
        ("[::1]:5555", ("::1", "5555")),
        ("[::1]x", ("::1", "x")),
    ],
)
def test_a_host_and_a_port_are_told_apart(text: str, parts: tuple[str, str]):
    assert host_and_port(text) == parts


@given(st.ip_addresses(v=4), st.integers(0, 65535))
def test_an_address_is_read_as_it_is_written(host: object, port: int):
    assert address(f"{host}:{port}") == Address(str(host), port)
    assert str(address(f"{host}:{port}")) == f"{host}:{port}"


@pytest.mark.parametrize(
    "text",
    ["", "127.0.0.1", "127.0.0.1:", ":8947", "127.1:8947", "localhost:8947", "[127.0.0.1]:8947", "[::1]:8947",
     "127.0.0.1:65536", "127.0.0.1:-1", "127.0.0.1:+1", "127.0.0.1: 1", "127.0.0.1:\u0661", "127.0.0.1:1:2"],
)  # fmt: skip
def test_what_is_no_ipv4_address_and_port_is_refused(text: str):
    with pytest.raises(ConfigurationError, match="invalid IPv4 address and port"):
        address(text)


@given(MACS)
def test_a_stations_address_is_six_octets(octets: bytes):
    assert mac_address(octets.hex(":")) == mac_address(octets.hex(":").upper()) == octets


@pytest.mark.parametrize(
    "text",
    ["", "02:00:00:00:00", "02:00:00:00:00:00:01", "2:0:0:0:0:1", "020000000001", "02-00-00-00-00-01",
     "02:00:00:00:00:-1", "02:00:00:00:00: 1", "02:00:00:00:00:zz", "03:00:00:00:00:01", "00:00:00:00:00:00"],
)  # fmt: skip
def test_what_is_no_address_of_one_station_is_refused(text: str):
    with pytest.raises(ConfigurationError, match="invalid MAC address of a station"):
        mac_address(text)


@given(st.text(max_size=30))
def test_any_text_is_an_address_or_refused(text: str):
    for read in (address, mac_address):
        try:
            read(text)
        except ConfigurationError:
            continue


@pytest.mark.parametrize("text", ["eth0", "wwan0", "v2x-0.5", "fünf", "a" * 15, "a\u2003b", "a\x1c"])
def test_a_device_may_have_any_name_that_the_kernel_takes(text: str):
    check_device_name(text)


@pytest.mark.parametrize(
    "text",
    ["", ".", "..", "a/b", "/dev/ttyUSB0", "eth0:1", "eth 0", "eth0\n", "a" * 16, "fünfzehnzeichen", "\u00e0"],
)
def test_a_name_that_the_kernel_refuses_is_told(text: str):
    with pytest.raises(ConfigurationError, match="invalid name of a network device"):
        check_device_name(text)
