"""Interfaces of captain.toml at what the owner reaches his box by."""

import struct

import pytest

from firmware.box import station_devices
from image.description import read
from tests.firmware.box.conftest import KEY, OVERLAY, Files, Look, mistakes, remarks

RADIO = '[interfaces.air]\ndriver = "som301e"\nlibrary = "lib/radio.so"\nip = "192.168.1.3"\n'


def library(machine: int) -> bytes:
    """The header of a shared library of 64 bits. Source: System V ABI, 4.1."""
    return struct.pack("<4sBB10xHH", b"\x7fELF", 2, 1, 3, machine) + bytes(44)


def files(driver: str, device: str) -> Files:
    return {"captain.toml": f'[interfaces.air]\ndriver = "{driver}"\ndevice = "{device}"\n', "authorized_keys": KEY}


def test_frames_at_the_cable_of_ssh_and_users_are_told(look: Look):
    found = look(files("ethernet", "eth0"))
    assert found.is_accepted
    assert remarks(found) == [
        "captain.toml:3: interfaces.air.device: eth0 is the network of ssh and of users: frames of V2X go to whoever is "
        "there; a radio's is another one"
    ]
    assert remarks(look(files("ethernet", "usb0"))) == []


def test_frames_at_the_wireless_network_are_told_once_it_is_one_of_users(look: Look):
    wifi = '[wifi]\ncountry = "DE"\nssid = "depot"\n'
    (said,) = remarks(look(files("ethernet", "wlan0") | {"box.toml": wifi}))
    assert said.startswith("captain.toml:3: interfaces.air.device: wlan0 is the network of ssh and of users")
    assert remarks(look(files("ethernet", "wlan0"))) == []


@pytest.mark.parametrize(("address", "is_hidden"), [("192.168.1.20/24", True), ("10.0.0.20/24", False)])
def test_a_radio_module_in_the_network_of_the_cable_is_a_mistake(look: Look, address: str, is_hidden: bool):
    box = f'[eth0]\naddress = "{address}"\n'
    found = look({"captain.toml": RADIO, "box.toml": box, "authorized_keys": KEY, "lib/radio.so": library(183)})
    said = (
        "captain.toml:4: interfaces.air.ip: 192.168.1.3 is in the network of eth0, 192.168.1.20/24: no way leads to the "
        "module; give eth0 another network in box.toml"
    )
    assert mistakes(found) == ([said] if is_hidden else [])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (library(183), ""),
        (library(183) + bytes(1 << 20), ""),
        (library(62), "library: lib/radio.so: is built for x86-64, 64 bit; the station runs as aarch64, 64 bit; install that for aarch64, 64 bit"),
        (b"MZ\x90\0", "library: lib/radio.so: is no shared library: it begins with 4d 5a 90 00"),
        (None, "library: there is no lib/radio.so; put it into lib/, beside captain.toml"),
    ],
)  # fmt: skip
def test_the_library_of_a_module_is_one_for_the_box_and_lies_on_the_card(look: Look, content: bytes | None, said: str):
    given: Files = {"captain.toml": RADIO, "authorized_keys": KEY}
    found = look(given if content is None else given | {"lib/radio.so": content})
    assert mistakes(found) == ([f"captain.toml:3: interfaces.air.{said}"] if said else [])
    assert remarks(found) == []
    assert found.files.get("lib/radio.so") == content


@pytest.mark.parametrize("machine", [183, 62])
def test_a_library_that_the_board_names_is_found_on_the_card_without_a_word(look: Look, machine: int):
    text = RADIO.replace("lib/radio.so", "radio.so")
    found = look({"captain.toml": text, "authorized_keys": KEY, "lib/radio.so": library(machine)})
    assert [note.text.partition(" is built")[0] for note in found.notes] == (
        [] if machine == 183 else ["captain.toml:3: interfaces.air.library: lib/radio.so:"]
    )
    assert look({"captain.toml": text, "authorized_keys": KEY}).notes == []


def test_a_library_that_is_on_no_card_or_that_nobody_names_is_told(look: Look):
    text = RADIO.replace("lib/radio.so", "/usr/lib/radio.so")
    found = look({"captain.toml": text, "authorized_keys": KEY, "lib/radio.so": library(183)})
    assert mistakes(found) == [
        "captain.toml:3: interfaces.air.library: /usr/lib/radio.so is not on the card; put it into lib/, beside captain.toml"
    ]
    assert remarks(found) == [
        'lib/radio.so: is named by no interface of captain.toml; for example: library = "lib/radio.so"'
    ]


@pytest.mark.parametrize(
    ("option", "is_told"),
    [
        ('listen = "0.0.0.0:9001"', True), ('group = "239.118.122.97:8947"', True), ('listen = "192.0.2.7:9001"', True),
        ('listen = "127.0.0.1:9001"', False), ('peers = ["192.0.2.7:9001"]', False),
    ],
)  # fmt: skip
def test_datagrams_that_the_firewall_lets_nobody_send_are_told(look: Look, option: str, is_told: bool):
    found = look({"captain.toml": f'[interfaces.air]\ndriver = "udp"\n{option}\n', "authorized_keys": KEY})
    assert found.is_accepted
    assert [text.partition(" the box")[0] for text in remarks(found)] == (
        [f"captain.toml:3: interfaces.air.{option.partition(' ')[0]}:"] if is_told else []
    )


@pytest.mark.parametrize("device", ["/dev/ttyS1", "/dev//ttyS1"])
def test_the_port_of_the_serial_console_is_not_taken_away(look: Look, device: str):
    found = look(files("uart", device))
    assert mistakes(found) == [
        "captain.toml:3: interfaces.air.device: /dev/ttyS1 is the serial console, and would be none any more; take another "
        "port, such as /dev/ttyUSB0"
    ]


def test_a_receiver_at_the_console_is_a_mistake_as_well(look: Look):
    text = '[interfaces.place]\ndriver = "zed_f9p"\nport = "/dev/ttyS1"\n'
    (told,) = mistakes(look({"captain.toml": text, "authorized_keys": KEY}))
    assert told.startswith("captain.toml:3: interfaces.place.port: /dev/ttyS1 is the serial console")


@pytest.mark.parametrize("device", ["/dev/ttyS0", "/dev/ttyAMA0"])
def test_a_port_at_no_pin_is_told(look: Look, device: str):
    found = look(files("uart", device))
    assert found.is_accepted
    assert [text.partition(": interfaces")[0] for text in remarks(found)] == ["captain.toml:3"]
    assert remarks(look(files("uart", "/dev/ttyUSB0"))) == []


@pytest.mark.parametrize("device", ["COM3", "ttyUSB0", "eth0", "../tty"])
def test_what_is_no_port_of_a_box_is_a_mistake(look: Look, device: str):
    assert mistakes(look(files("uart", device))) == [
        f'captain.toml:3: interfaces.air.device: "{device}" is no serial port of a box; /dev/ttyUSB0 is the first by USB'
    ]


def test_a_surveyed_place_needs_no_port(look: Look):
    place = (
        '[interfaces.place]\ndriver = "zed_f9p"\nkind = "static"\nlatitude = 48.1\nlongitude = 11.6\nport = "COM3"\n'
    )
    assert look({"captain.toml": place, "authorized_keys": KEY}).notes == []


@pytest.mark.parametrize(
    ("folder", "is_told"),
    [("/home/me", True), ("pins", True), ("/var/lib/captain", False), ("/var/lib/captain/cell/", False)],
)
def test_a_modem_remembers_where_the_station_may_write(look: Look, folder: str, is_told: bool):
    cell = f'[interfaces.cell]\ndriver = "sim8202g"\nusb = "1-1.4"\nstate_dir = "{folder}"\n'
    found = look({"captain.toml": cell, "authorized_keys": KEY})
    assert found.is_accepted
    assert [text.partition(" on a box")[0] for text in remarks(found)] == (
        [f"captain.toml:4: interfaces.cell.state_dir: the station cannot write {folder}"] if is_told else []
    )


def test_the_console_of_the_image_is_the_one_that_is_kept():
    assert f"/dev/{read(OVERLAY.parent / 'image.toml').console.device}" == station_devices.CONSOLE


@pytest.mark.parametrize("name", ["OPENSSH PRIVATE KEY", "RSA PRIVATE KEY", "EC PRIVATE KEY", "ENCRYPTED PRIVATE KEY"])
def test_a_private_key_among_the_public_ones_is_named_and_never_shown(look: Look, name: str):
    found = look({"authorized_keys": f"-----BEGIN {name}-----\nc2VjcmV0c2VjcmV0\n-----END {name}-----\n{KEY}\n"})
    assert not found.is_accepted
    assert [text.partition(",")[0] for text in mistakes(found)] == ["authorized_keys:1: is a private key"]
    assert not any("c2VjcmV0" in note.text for note in found.notes)
