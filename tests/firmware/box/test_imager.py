"""Raspberry Pi Imager's customisation: what is taken of it as data, and what is named and not taken."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as some

from firmware.box.imager import Imager
from firmware.box.note import Note
from tests.firmware.box.conftest import KEY, Look, mistakes, remarks
from tests.firmware.box.imager_card import CMDLINE, NETWORK, PSK, USER_DATA


def test_host_name_keys_time_zone_and_wifi_are_taken(look: Look):
    found = look({"user-data": USER_DATA, "network-config": NETWORK, "cmdline.txt": CMDLINE, "meta-data": "x: y\n"})
    assert mistakes(found) == []
    options = found.options
    assert (options.host_name, options.time_zone, found.keys) == ("captain-7", "Europe/Berlin", [KEY])
    assert options.wifi is not None
    assert (options.wifi.country, options.wifi.ssid) == ("DE", 'Café "Nord"')
    assert (options.wifi.password, options.wifi.hidden) == (PSK, True)


def test_each_key_that_is_not_taken_is_named_and_passwords_are_refused_with_words(look: Look):
    told = remarks(look({"user-data": USER_DATA, "network-config": NETWORK}))
    refused = "is refused: no password exists on this box; ssh takes keys only: give an ssh key"
    assert told == [
        "user-data:4: packages is not taken: nothing is run or installed",
        "user-data:6: apt is not taken: nothing is run or installed",
        f"user-data:21: passwd {refused}",
        'user-data:17: no user "pi" is made; its ssh keys are operator\'s; log in as operator',
        f"user-data:25: ssh_pwauth {refused}",
        "user-data:26: runcmd is not taken: nothing is run or installed",
        "user-data: not taken: keyboard (line 12)",
    ]
    assert not any("$5$" in text for text in told)


def test_the_templates_of_raspberry_pi_os_which_are_comments_say_nothing(look: Look):
    found = look(
        {"user-data": "#cloud-config\n# hostname: x\n", "network-config": "#network:\n", "authorized_keys": KEY}
    )
    assert found.notes == []


def test_a_static_address_is_taken_as_netplan_writes_it(look: Look):
    text = """\
version: 2
ethernets:
  eth0:
    dhcp4: false
    addresses: [10.0.0.20/24]
    routes:
      - to: default
        via: 10.0.0.1
    nameservers:
      addresses: [10.0.0.1, 9.9.9.9]
  eth1:
    dhcp4: true
"""
    found = look({"network-config": text, "authorized_keys": KEY})
    assert mistakes(found) == []
    eth0 = found.options.eth0
    assert eth0 is not None
    assert (eth0.address, eth0.gateway, eth0.dns) == ("10.0.0.20/24", "10.0.0.1", ("10.0.0.1", "9.9.9.9"))
    assert remarks(found) == ["network-config: not taken: eth1 (line 11)"]


def test_an_open_network_has_the_empty_password_that_imager_writes(look: Look):
    found = look({"network-config": NETWORK.replace(PSK, "")})
    assert found.is_accepted
    assert found.options.wifi is not None
    assert found.options.wifi.password is None


def test_the_country_of_the_command_line_counts_where_the_network_has_none(look: Look):
    without = NETWORK.replace('      regulatory-domain: "DE"\n', "")
    assert look({"network-config": without, "cmdline.txt": CMDLINE}).is_accepted
    assert mistakes(look({"network-config": without})) == [
        'network-config:7: regulatory-domain: is missing; for example regulatory-domain: "DE"'
    ]


def test_what_two_files_say_differently_is_told_with_both_places(look: Look):
    box = 'host_name = "captain-8"\n[wifi]\ncountry = "DE"\nssid = "depot"\npassword = "12345678"\n'
    assert mistakes(look({"box.toml": box, "user-data": USER_DATA, "network-config": NETWORK})) == [
        'box.toml:1: host_name is "captain-8", but "captain-7" in user-data:2; remove the one that is not meant',
        'box.toml:4: wifi.ssid is "depot", but "Café "Nord"" in network-config:8; remove the one that is not meant',
    ]


def test_two_passwords_for_a_network_are_told_and_neither_is_shown(look: Look):
    box = 'host_name = "captain-7"\n[wifi]\ncountry = "DE"\nssid = \'Café "Nord"\'\npassword = "aaaaaaaaaa"\n'
    network = NETWORK.replace(PSK, "hunter2hunter2")
    (said,) = mistakes(look({"box.toml": box, "network-config": network}))
    assert said.startswith("box.toml:5: wifi.password is another one than in network-config:")
    assert not {word for word in ("aaaaaaaaaa", "hunter2hunter2") if word in said}


def test_of_two_ways_out_the_second_is_not_taken_and_told(look: Look):
    text = "version: 2\nethernets:\n  eth0:\n    addresses: [10.0.0.20/24]\n    routes:\n"
    text += "".join(f"      - to: default\n        via: 10.0.0.{last}\n" for last in (1, 9))
    found = look({"network-config": text, "authorized_keys": KEY})
    assert found.options.eth0 is not None
    assert found.options.eth0.gateway == "10.0.0.1"
    assert remarks(found) == ["network-config: not taken: routes[1] (line 8)"]


def test_what_two_files_say_alike_is_said_once(look: Look):
    box = 'host_name = "captain-7"\n[wifi]\ncountry = "DE"\nssid = \'Café "Nord"\'\npassword = "12345678"\n'
    found = look({"box.toml": box, "user-data": USER_DATA, "network-config": NETWORK, "authorized_keys": KEY})
    assert mistakes(found) == []
    assert found.keys == [KEY]
    assert found.options.wifi is not None
    assert found.options.wifi.password == "12345678"


def test_a_letter_that_json_writes_as_two_halves_is_one(look: Look):
    # JSON is YAML; RFC 8259, clause 7
    points = {"r\U0001f600d": {"password": "12345678"}}
    wlan0 = {"regulatory-domain": "DE", "access-points": points}
    found = look({"network-config": json.dumps({"version": 2, "wifis": {"wlan0": wlan0}}), "authorized_keys": KEY})
    assert found.is_accepted
    assert found.options.wifi is not None
    assert found.options.wifi.ssid == "r\U0001f600d"


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("user-data", "hostname:\n\t- x\n", "user-data:2: is not YAML: found character '\\t' that cannot start any token; indent by blanks: YAML takes no tab"),
        ("user-data", "hostname: a: b\n", "user-data:1: is not YAML: mapping values are not allowed here"),
        ("user-data", "hostname: [a]\n", "user-data:1: hostname is a list, not text; write one value there"),
        ("user-data", "hostname: a\nhostname: b\n", "user-data:2: hostname stands there a second time, first in line 1"),
        ("user-data", "users: pi\n", 'user-data:1: users is "pi", not a list; write each in a line of its own, with a - before it'),
        ("user-data", "users: {name: pi}\n", "user-data:1: users is keys with values, not a list; write each in a line of its own, with a - before it"),
        ("user-data", "ssh_authorized_keys: [[a]]\n", "user-data:1: ssh_authorized_keys[0] is a list, not text; write one value there"),
        ("user-data", "? [a, b]\n: c\n", "user-data:1: a key is a list, not text; write key: value"),
        ("user-data", "users: &a []\nx: *a\n", "user-data:2: has an alias, which is not taken; write in its place what it stands for"),
        ("user-data", "- x\n", "user-data: this is a list, not keys with values; write key: value, each in a line of its own"),
        ("user-data", "hello\n", "user-data: this is text, not keys with values; write key: value, each in a line of its own"),
        ("user-data", "hostname: raspberry_pi\n", 'user-data:1: host_name: "raspberry_pi" is no host name'),
        ("user-data", "ssh_authorized_keys:\n  - ssh-ed25519 AAAA\n", "user-data:2: the key "),
        ("user-data", 'timezone: UTC\nhostname: "cap\\ud83d"\n', "user-data:2: is not YAML: found half of a letter without its other half"),
        ("user-data", '"\\ude00\\ud83d": x\n', "user-data:1: is not YAML: found half of a letter without its other half"),
        ("user-data", 'hostname: "\\U00110000"\n', "user-data: is not YAML: "),
        ("user-data", f"%YAML {'9' * 5000}.1\n---\nhostname: x\n", "user-data: is not YAML: "),
        ("user-data", "\nhostname: " + "[" * 2000, "user-data:2: is nested too deep; is it the right file?"),
        ("network-config", "version: 1\nconfig: []\n", "network-config:1: version 1 is not read; write it as netplan has it: version: 2"),
        ("network-config", NETWORK.replace('"DE"', '"Germany"'), 'network-config:6: wifi.country: "Germany" is no country'),
        ("network-config", NETWORK.replace(PSK, "short"), "network-config:10: wifi.password: has 5 characters"),
        ("network-config", NETWORK.replace(f'"{PSK}"', "[x]"), "network-config:10: password is a list, not text; write one value there"),
        ("network-config", NETWORK.replace(": true", ": ja", 1), 'network-config:5: dhcp4 is "ja", which is neither true nor false; write one of them'),
        ("network-config", NETWORK.replace("hidden: true", "hidden: ja"), 'network-config:9: hidden is "ja", which is neither true nor false; write one of them'),
        ("network-config", NETWORK.replace("hidden: true", "hidden: [yes]"), "network-config:9: hidden is a list, not text; write one value there"),
        ("network-config", NETWORK.replace(f'"{PSK}"', ""), "network-config:10: password: is missing"),
        ("network-config", NETWORK.replace(f'password: "{PSK}"', "auth: {key-management: eap}"), "network-config:10: key-management: \"eap\" is not what this box can join with"),
    ],
)  # fmt: skip
def test_a_mistake_in_it_is_named(look: Look, name: str, text: str, said: str):
    found = look({name: text})
    assert len(mistakes(found)) == 1
    assert mistakes(found)[0].startswith(said)


@pytest.mark.parametrize("word", ["true", "Yes", "on", "y", "false", "No", "OFF", "n"])
def test_true_and_false_are_said_in_every_word_that_netplan_takes(look: Look, word: str):
    found = look({"network-config": NETWORK.replace("hidden: true", f"hidden: {word}"), "authorized_keys": KEY})
    assert found.is_accepted
    assert found.options.wifi is not None
    assert found.options.wifi.hidden is (word.lower() in ("true", "yes", "on", "y"))


def test_a_password_in_the_wrong_place_is_not_told(look: Look):
    for text in ("{auth: geheim77}", "geheim77", "{password: [geheim77]}"):
        network = f"version: 2\nwifis:\n  wlan0:\n    regulatory-domain: DE\n    access-points:\n      depot: {text}\n"
        found = look({"network-config": network})
        assert mistakes(found)
        assert not any("geheim77" in note.text for note in found.notes)


def test_of_thousands_of_keys_that_are_not_taken_the_first_are_named(look: Look):
    found = look({"user-data": "".join(f"k{number}: 1\n" for number in range(1, 2000)), "authorized_keys": KEY})
    assert remarks(found) == [
        "user-data: not taken: k1 (line 1), k2 (line 2), k3 (line 3), k4 (line 4), k5 (line 5), k6 (line 6), k7 (line 7), "
        "k8 (line 8), k9 (line 9), k10 (line 10), and 1989 more"
    ]


def test_a_script_is_not_run(look: Look):
    found = look({"user-data": "#!/bin/sh\nreboot\n", "authorized_keys": KEY})
    assert remarks(found) == ["user-data: is a script: it is not run; this box takes #cloud-config only"]


@given(text=some.text(alphabet=":-[]{}\"' \n#&*!|>%ab\t1", max_size=80))
def test_any_text_is_read_or_named(text: str):
    notes: list[Note] = []
    imager = Imager()
    imager.read_user_data("user-data", text, notes)
    imager.read_network_config("network-config", text, notes)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ("dhcp4: false", "dhcp4: false is not taken: without an address of its own the box asks by DHCP; give addresses: [10.0.0.20/24]"),
        ("dhcp4: no", "dhcp4: false is not taken: without an address of its own the box asks by DHCP; give addresses: [10.0.0.20/24]"),
        ("dhcp4: true\n      addresses: [10.0.0.2/24]", "dhcp4: true is not taken: with an address of its own the box asks nobody; leave one out"),
        ("dhcp4: false\n      addresses: [10.0.0.2/24]", None),
        ("dhcp4: true", None),
        ("optional: true", None),
    ],
)  # fmt: skip
def test_what_is_said_of_dhcp_and_not_done_is_told(look: Look, lines: str, said: str | None):
    found = look({"network-config": f"version: 2\nethernets:\n    eth0:\n      {lines}\n", "authorized_keys": KEY})
    assert remarks(found) == ([f"network-config:4: {said}"] if said else [])
    assert found.is_accepted


def test_wifi_without_dhcp_is_told(look: Look):
    found = look({"network-config": NETWORK.replace("dhcp4: true", "dhcp4: false"), "authorized_keys": KEY})
    assert remarks(found) == [
        "network-config:5: dhcp4: false is not taken: without an address of its own the box asks by DHCP; that of wlan0 is "
        "always given to it"
    ]
