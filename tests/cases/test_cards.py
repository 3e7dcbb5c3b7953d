"""Cards of public reports: the name of the network, its password and what is said of the rest."""

import time
from pathlib import Path

import pytest

from firmware.card.system_files import system_files
from firmware.card.verdict import verdict
from tests.firmware.card.conftest import mistakes, remarks

CASES = Path(__file__).parent
PROJECT = CASES.parents[1]
SUPPLICANT = "etc/wpa_supplicant/wpa_supplicant-wlan0.conf"
KEY = "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIDKoIWpKOFhxeiip4Ver+Iw4M73aczHbKYwAzk+ZqB1X phone"


@pytest.fixture
def look(tmp_path):
    """What a box says of a folder of this directory, with further files, or others in place of those."""

    def looked(case, **more):
        card, scratch = tmp_path / "card", tmp_path / "scratch"
        card.mkdir()
        scratch.mkdir()
        for path in (CASES / case).iterdir():
            (card / path.name).write_bytes(path.read_bytes())
        for name, text in more.items():
            (card / name.replace("_", "-").replace("-txt", ".txt")).write_text(text, encoding="utf-8")
        return verdict(card, scratch, "none", None, time.time())

    return looked


def network(name):
    """A network-config as Imager writes it, with the name of the network as it stands in the file."""
    return (
        'network:\n  version: 2\n  wifis:\n    wlan0:\n      regulatory-domain: "DE"\n      access-points:\n'
        f'        {name}:\n          password: "12345678"\n'
    )


def lines(found):
    return system_files(found.options, set())[SUPPLICANT].text.split("\n")


def test_a_network_name_escaped_octet_by_octet_is_read_as_its_letters(look):
    # 9 octets of UTF-8, each written as a letter of its own: rpi-imager 2.0.10, its issue 1743
    found = look("box-ssid-mojibake")
    assert mistakes(found) == []
    assert found.options.wifi.ssid == "\u6211\u7684\u7f51"
    assert "    ssid=e68891e79a84e7bd91" in lines(found)
    assert remarks(found)[-1] == (
        'network-config:8: SSID read as "\u6211\u7684\u7f51": Imager 2.0.10 escaped its UTF-8 octets; '
        "if that is wrong, write the SSID without \\x"
    )


@pytest.mark.parametrize(
    ("written", "ssid"),
    [
        (r'"Caf\xc3\xa9 Nord"', "Caf\u00e9 Nord"),
        (r'"Caf\xC3\xA9"', "Caf\u00e9"),
        (r'"\xf0\x9f\x98\x8d"', "\U0001f60d"),
        (r'"don\xe2\x80\x99t"', "don\u2019t"),
    ],
)
def test_a_network_name_of_escaped_octets_is_put_together(look, written, ssid):
    found = look("box-ssid-mojibake", network_config=network(written))
    assert found.options.wifi.ssid == ssid
    assert any(f'SSID read as "{ssid}"' in text for text in remarks(found))


@pytest.mark.parametrize(
    ("written", "ssid"),
    [
        ('"Caf\u00e9"', "Caf\u00e9"),
        ("Caf\u00e9", "Caf\u00e9"),
        (r'"Caf\xe9"', "Caf\u00e9"),  # YAML's own escape of one letter; its octet is no UTF-8
        (r'"\xc3\xa9\xe9"', "\u00c3\u00a9\u00e9"),
        ('"\u00c3\u00a9"', "\u00c3\u00a9"),  # letters as they are, though their Latin-1 octets are UTF-8
        ("'\u00c3\u00a9'", "\u00c3\u00a9"),
        (r'"\u00c3\u00a9"', "\u00c3\u00a9"),
        ('"\\xc3\u00a9"', "\u00c3\u00a9"),
        (r"'\xc3\xa9'", r"\xc3\xa9"),  # single quotes: no escape at all
        (r'"\\xc3\\xa9"', r"\xc3\xa9"),
        ('"\u6211\u7684\u7f51"', "\u6211\u7684\u7f51"),
        ('"depot"', "depot"),
    ],
)
def test_a_network_name_with_letters_of_its_own_is_left_as_it_is(look, written, ssid):
    found = look("box-ssid-mojibake", network_config=network(written))
    assert mistakes(found) == []
    assert found.options.wifi.ssid == ssid
    assert not any("is read as" in text for text in remarks(found))


def test_a_second_network_is_named_by_its_letters_too(look):
    text = network(r'"\xc3\xa9"') + '        "\\xc3\\xb6":\n          password: "12345678"\n'
    told = remarks(look("box-ssid-mojibake", network_config=text))
    assert any('a second network, "\u00f6", is ignored' in line for line in told)


def test_a_network_name_with_blanks_is_taken_once_its_country_is_known(look):
    found = look("box-iiab", cmdline_txt="cfg80211.ieee80211_regdom=US")
    assert mistakes(found) == []
    assert (found.options.wifi.ssid, found.options.wifi.password) == ("SSID with spaces", "tsikada1")
    assert (found.options.host_name, found.options.time_zone, found.keys) == ("box", "America/Chicago", [KEY])


def test_a_network_without_a_country_is_refused_and_the_key_still_counts(look):
    found = look("box-iiab")
    assert mistakes(found) == ['network-config:9: regulatory-domain: is missing; for example regulatory-domain: "DE"']
    assert found.keys == [KEY]


def test_a_password_of_signs_and_a_name_with_an_apostrophe_are_taken_as_they_are(look):
    found = look("box-special")
    assert mistakes(found) == []
    wifi = found.options.wifi
    assert (wifi.ssid, wifi.hidden, wifi.country) == ("Wang's WiFi", True, "US")
    assert wifi.password == 'A$T@Crlp[}l@"Ilovefishes"Ido!#%&*\\'
    # wpa_supplicant.conf(5): a text in quotes ends at the last quote of its line, and has no escapes
    assert '    psk="A$T@Crlp[}l@"Ilovefishes"Ido!#%&*\\"' in lines(found)
    assert "    ssid=57616e6727732057694669" in lines(found)


def test_guide_flash_with_imager_2_names_the_manifest_or_copies_by_hand():
    page = (PROJECT / "image/guide/flash.md").read_text()
    flash = " ".join(page[page.index("## Flash") : page.index("## Your files")].split())
    assert "Imager 2 writes no customisation for a custom image" in flash
    assert "copy [your files](#your-files) onto the card by hand" in flash
    assert ".rpi-imager-manifest" in flash


def test_card_text_with_imager_2_names_the_manifest_or_copies_by_hand():
    text = " ".join((PROJECT / "image/first/README.txt").read_text().split())
    assert 'Imager 2 cannot customise an image chosen with "Use custom"' in text
    assert "copy your files here by hand" in text
    assert ".rpi-imager-manifest" in text
