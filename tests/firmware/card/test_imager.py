"""Raspberry Pi Imager's customisation: what is taken of it as data, and what is named and not taken."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as some

from firmware.card.imager import Imager
from firmware.card.note import Note
from tests.firmware.card.conftest import KEY, Files, Look, mistakes, noted, refused, remarks
from tests.firmware.card.imager_card import CMDLINE, NETWORK, NETWORK_WITH_CABLE, PSK, USER_DATA

BOX = 'host_name = "captain-{}"\n[wifi]\ncountry = "DE"\nssid = {}\npassword = "{}"\n'
NORTH = "'Café \"Nord\"'"
WITHOUT = NETWORK.replace('      regulatory-domain: "DE"\n', "")
STATIC = """\
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
TWO_WAYS = "version: 2\nethernets:\n  eth0:\n    addresses: [10.0.0.20/24]\n    routes:\n" + "".join(
    f"      - to: default\n        via: 10.0.0.{last}\n" for last in (1, 9)
)


def test_files_of_imager_give_host_name_keys_time_zone_and_wifi(look: Look):
    found = look({"user-data": USER_DATA, "network-config": NETWORK, "cmdline.txt": CMDLINE, "meta-data": "x: y\n"})
    assert mistakes(found) == []
    options = found.options
    assert (options.host_name, options.time_zone, found.keys) == ("captain-7", "Europe/Berlin", [KEY])
    assert options.wifi is not None
    assert (options.wifi.country, options.wifi.ssid) == ("DE", 'Café "Nord"')
    assert (options.wifi.password, options.wifi.hidden) == (PSK, True)


def test_key_of_imager_that_is_not_taken_is_told_with_its_line(look: Look):
    # the wording of each kind of them
    refused = "is refused: the box has no passwords; give an ssh key"
    assert remarks(look({"user-data": USER_DATA, "network-config": NETWORK})) == [
        "user-data:5: packages is ignored: the box runs and installs nothing",
        "user-data:7: apt is ignored: the box runs and installs nothing",
        f"user-data:22: passwd {refused}",
        'user-data:18: user "pi" is not created; its ssh keys log in as operator; log in as operator',
        f"user-data:27: ssh_pwauth {refused}",
        "user-data:28: rpi is ignored: the box runs and installs nothing",
        "user-data:31: runcmd is ignored: the box runs and installs nothing",
        "user-data: keys ignored: keyboard (line 14)",
    ]


def test_network_config_with_the_cable_by_dhcp_is_taken_without_a_remark(look: Look):
    found = look({"network-config": NETWORK_WITH_CABLE, "authorized_keys": KEY})
    assert (mistakes(found), remarks(found), found.options.eth0) == ([], [], None)
    assert found.options.wifi is not None
    assert found.options.wifi.ssid == 'Café "Nord"'


def test_address_of_netplan_is_taken_with_the_first_way_out(look: Look):
    found = look({"network-config": STATIC, "authorized_keys": KEY})
    eth0 = found.options.eth0
    assert eth0 is not None
    assert (eth0.address, eth0.gateway, eth0.dns) == ("10.0.0.20/24", "10.0.0.1", ("10.0.0.1", "9.9.9.9"))
    found = look({"network-config": TWO_WAYS, "authorized_keys": KEY})
    assert found.options.eth0 is not None
    assert found.options.eth0.gateway == "10.0.0.1"


@pytest.mark.parametrize("word", ["true", "Yes", "on", "y", "false", "No", "OFF", "n"])
def test_flag_of_netplan_in_any_of_its_words_is_taken(look: Look, word: str):
    found = look({"network-config": NETWORK.replace("hidden: true", f"hidden: {word}"), "authorized_keys": KEY})
    assert found.is_accepted
    assert found.options.wifi is not None
    assert found.options.wifi.hidden is (word.lower() in ("true", "yes", "on", "y"))


@pytest.mark.parametrize(
    ("files", "wifi"),
    [
        ({"network-config": NETWORK.replace(PSK, "")}, ('Café "Nord"', None)),
        ({"network-config": WITHOUT, "cmdline.txt": CMDLINE}, ('Café "Nord"', PSK)),
        # JSON is YAML, and writes a letter beyond U+FFFF as two halves; RFC 8259, clause 7
        ({"network-config": json.dumps({"version": 2, "wifis": {"wlan0": {
            "regulatory-domain": "DE", "access-points": {"r\U0001f600d": {"password": "12345678"}}}}})},
         ("r\U0001f600d", "12345678")),
        ({"network-config": NETWORK, "user-data": USER_DATA, "box.toml": BOX.format(7, NORTH, "12345678")},
         ('Café "Nord"', "12345678")),
        ({"network-config": NETWORK, "box.toml": BOX.format(7, NORTH, "x").replace('password = "x"', f'psk = "{64 * "a"}"')},
         ('Café "Nord"', None)),
        ({"user-data": "hostname: a\nhostname: captain-7\n"}, None),
        ({"user-data": "? [a, b]\n: c\nhostname: captain-7\n"}, None),
        ({"user-data": "hostname: &a captain-7\ntimezone: UTC\nkeyboard: *a\n"}, None),
        ({"user-data": "hostname: captain-7\nusers:\n"}, None),
    ],
)  # fmt: skip
def test_set_of_imager_that_is_sound_is_taken(look: Look, files: Files, wifi: tuple[str, str | None] | None):
    found = look(files | {"authorized_keys": KEY})
    assert (mistakes(found), found.keys) == ([], [KEY])
    if wifi is None:
        assert found.options.host_name == "captain-7"
        return
    assert found.options.wifi is not None
    assert (found.options.wifi.ssid, found.options.wifi.password) == wifi


# Files, the places and keys of their mistakes, and what these name.
MISTAKES: list[tuple[Files, list[str], list[str]]] = [
    ({"user-data": "hostname:\n\t- x\n"}, ["user-data:2"], [r"'\t'"]),
    ({"user-data": "hostname: a: b\n"}, ["user-data:1"], []),
    ({"user-data": "hostname: [a]\n"}, ["user-data:1"], ["hostname"]),
    ({"user-data": "users: pi\n"}, ["user-data:1"], ["users"]),
    ({"user-data": "users: {name: pi}\n"}, ["user-data:1"], ["users"]),
    ({"user-data": "ssh_authorized_keys: [[a]]\n"}, ["user-data:1"], ["ssh_authorized_keys[0]"]),
    ({"user-data": "- x\n"}, ["user-data"], []),
    ({"user-data": "hello\n"}, ["user-data"], []),
    ({"user-data": "hostname: raspberry_pi\n"}, ["user-data:1 host_name"], ['"raspberry_pi"']),
    ({"user-data": "ssh_authorized_keys:\n  - ssh-ed25519 AAAA\n"}, ["user-data:2"], ["AAAA"]),
    ({"user-data": 'hostname: "cap\\ud83d"\n'}, ["user-data:1 host_name"], []),
    ({"user-data": 'hostname: "\\U00110000"\n'}, ["user-data"], []),
    ({"user-data": f"%YAML {'9' * 5000}.1\n---\nhostname: x\n"}, ["user-data"], []),
    ({"user-data": "hostname: *a\n"}, ["user-data:1"], ["'a'"]),
    ({"network-config": "version: 1\nconfig: []\n"}, ["network-config:1"], ["version 1", "version: 2"]),
    ({"network-config": WITHOUT}, ["network-config:7 regulatory-domain"], ['"DE"']),
    ({"network-config": "version: 2\nethernets:\n  eth0:\n    gateway4: 10.0.0.1\n"}, ["network-config:4 addresses"], ["10.0.0.20/24"]),
    ({"network-config": NETWORK.replace('"DE"', '"Germany"')}, ["network-config:6 wifi.country"], ['"Germany"']),
    ({"network-config": NETWORK.replace(PSK, "short")}, ["network-config:10 wifi.password"], ["5"]),
    ({"network-config": NETWORK.replace(f'"{PSK}"', "[x]")}, ["network-config:10"], ["password"]),
    ({"network-config": NETWORK.replace(f'"{PSK}"', "")}, ["network-config:10 password"], ['password: ""']),
    ({"network-config": NETWORK.replace(": true", ": ja", 1)}, ["network-config:5 dhcp4"], ["dhcp4", '"ja"']),
    ({"network-config": NETWORK.replace("hidden: true", "hidden: ja")}, ["network-config:9 hidden"], ["hidden", '"ja"']),
    ({"network-config": NETWORK.replace("hidden: true", "hidden: [yes]")}, ["network-config:9"], ["hidden"]),
    ({"network-config": NETWORK.replace(f'password: "{PSK}"', "auth: {key-management: eap}")}, ["network-config:10 key-management"], ['"eap"', "psk"]),
    ({"network-config": NETWORK, "user-data": USER_DATA, "box.toml": BOX.format(8, '"depot"', "12345678")}, ["box.toml:1", "box.toml:4"],
     ['host_name is "captain-8"', '"captain-7" in user-data:3', 'wifi.ssid is "depot"', "network-config:8"]),
    # two passwords, of which neither is shown
    ({"network-config": NETWORK.replace(PSK, "hunter2hunter2"), "box.toml": BOX.format(7, NORTH, "aaaaaaaaaa")}, ["box.toml:5"], ["network-config:10"]),
]  # fmt: skip


@pytest.mark.parametrize(("files", "places", "values"), MISTAKES)
def test_set_of_imager_with_mistakes_names_each_place_and_value(
    look: Look, files: Files, places: list[str], values: list[str]
):
    found = look(files)
    said = "\n".join(mistakes(found))
    assert refused(found) == places
    assert [value for value in values if value not in said] == []
    assert not {word for word in ("aaaaaaaaaa", "hunter2hunter2", "$5$") if word in said}


def ethernet(lines: str) -> Files:
    return {"network-config": f"version: 2\nethernets:\n    eth0:\n      {lines}\n"}


COMMANDS = "runcmd bootcmd write_files packages apt snap rpi"
PASSWORDS = "passwd plain_text_passwd hashed_passwd password chpasswd ssh_pwauth"
GRANTED = "manage_etc_hosts enable_ssh lock_passwd optional version renderer shell dhcp4 dhcp6"
MANY = "".join(f"k{number}: 1\n" for number in range(1, 2000))
TOLD: list[tuple[Files, list[str], list[str]]] = [
    ({"user-data": "#cloud-config\n# hostname: x\n", "network-config": "#network:\n"}, [], []),
    ({"user-data": "#!/bin/sh\nreboot\n"}, ["user-data"], ["#cloud-config"]),
    ({"user-data": "hostname: a\n\nhostname: b\nhostname: c\n"}, ["user-data:3 hostname", "user-data:4 hostname"], ["line 1", "line 3"]),
    ({"network-config": NETWORK + "    wlan0: {}\n"}, ["network-config:12 wlan0"], ["line 4"]),
    ({"user-data": MANY}, ["user-data"], ["k1 (line 1)", "k10 (line 10), and 1989 more"]),
    ({"user-data": "".join(f"k{number}: 1\n" for number in range(10))}, ["user-data"], ["k9 (line 10)"]),
    ({"user-data": "ssh_pwauth: no\nusers:\n- default\n- name: operator\n  ssh_authorized_keys: []\n"}, [], []),
    ({"network-config": STATIC}, ["network-config"], ["eth1 (line 11)"]),
    ({"network-config": STATIC.replace("addresses: [10.0.0.1", "search: [x]\n      addresses: [10.0.0.1")}, ["network-config"], ["search (line 10), eth1 (line 12)"]),
    ({"network-config": TWO_WAYS}, ["network-config"], ["routes[1] (line 8)"]),
    ({"network-config": NETWORK + "    wlan1: {}\n"}, ["network-config"], ["wlan1 (line 12)"]),
    ({"network-config": NETWORK.replace(f'password: "{PSK}"', f'auth: {{key-management: psk, password: "{PSK}"}}')}, [], []),
    ({"network-config": NETWORK.replace("      optional", "        depot: {}\n      optional")}, ["network-config:11"], ['"depot"']),
    ({"network-config": NETWORK.replace("dhcp4: true", "dhcp4: false")}, ["network-config:5 dhcp4"], ["wlan0"]),
    (ethernet("dhcp4: false"), ["network-config:4 dhcp4"], ["[10.0.0.20/24]"]),
    (ethernet("dhcp4: no"), ["network-config:4 dhcp4"], ["[10.0.0.20/24]"]),
    (ethernet("dhcp4: true\n      addresses: [10.0.0.2/24]"), ["network-config:4 dhcp4"], []),
    (ethernet("dhcp4: false\n      addresses: [10.0.0.2/24]"), [], []),
    (ethernet("dhcp4: true"), [], []),
    (ethernet("optional: true"), [], []),
    (ethernet("addresses: [10.0.0.2/24, 10.0.0.3/24]"), ["network-config"], ["addresses[1] (line 4)"]),
    *(
        ({"network-config": NETWORK.replace(f'password: "{PSK}"', f'auth: {{key-management: {word}, password: "{PSK}"}}')}, [], [])
        for word in ("none", "psk", "psk-sha256", "sae")
    ),
    *(({"user-data": f"{key}: x\n"}, ["user-data:1"], [key]) for key in COMMANDS.split()),
    *(({"user-data": f"{key}: x\n"}, ["user-data:1"], [key]) for key in PASSWORDS.split()),
    *(({"user-data": f"{key}: true\n"}, [], []) for key in GRANTED.split()),
    ({"cmdline.txt": CMDLINE}, [], []),
    ({"network-config": "version: 2\nwifis:\n  wlan0:\n    regulatory-domain: DE\n"}, [], []),
]  # fmt: skip


@pytest.mark.parametrize(("files", "places", "values"), TOLD)
def test_set_of_imager_without_mistakes_is_taken_and_told_what_is_not(
    look: Look, files: Files, places: list[str], values: list[str]
):
    found = look(files | {"authorized_keys": KEY})
    assert (mistakes(found), noted(found)) == ([], places)
    assert [value for value in values if value not in "\n".join(remarks(found))] == []


@given(text=some.text(alphabet=":-[]{}\"' \n#&*!|>%ab\t1", max_size=80))
def test_text_of_any_signs_is_read_or_named(text: str):
    notes: list[Note] = []
    imager = Imager()
    imager.read_user_data("user-data", text, notes)
    imager.read_network_config("network-config", text, notes)
