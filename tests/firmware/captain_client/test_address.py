"""Addresses of a station, as users write them."""

import pytest

from captain_client.address import Address, parse


@pytest.mark.parametrize(
    ("text", "host", "first"),
    [
        ("", "127.0.0.1", 5555),
        ("captain-7.local", "captain-7.local", 5555),
        (":5565", "127.0.0.1", 5565),
        ("10.0.0.7:5565", "10.0.0.7", 5565),
        ("[fd00::7]:65532", "fd00::7", 65532),
        ("fd00::7", "fd00::7", 5555),
    ],
)
def test_address_with_a_valid_text_has_four_consecutive_ports(text: str, host: str, first: int):
    assert parse(text) == Address(host, first, first + 1, first + 2, first + 3)


@pytest.mark.parametrize("text", ["5565", "tcp://10.0.0.7:5565", ":0", ":65533", ":x", ":٣", "host:123456", ":-1"])
def test_address_with_an_invalid_text_raises_value_error(text: str):
    with pytest.raises(ValueError, match=r"port|without"):
        parse(text)


def test_url_of_an_ipv6_address_has_brackets():
    assert parse("[fd00::7]").url(5558) == "tcp://[fd00::7]:5558"
