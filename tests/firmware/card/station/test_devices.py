"""Interfaces of captain.toml at what the owner reaches his box by."""

import struct

import pytest

from firmware.card.station import devices
from image.description import read
from tests.firmware.card.conftest import KEY, OVERLAY, Files, Look, noted, refused

RADIO = '[interfaces.air]\ndriver = "som301e"\nlibrary = "lib/radio.so"\nip = "192.168.1.3"\n'


def library(machine: int) -> bytes:
    """The header of a shared library of 64 bits. Source: System V ABI, 4.1."""
    return struct.pack("<4sBB10xHH", b"\x7fELF", 2, 1, 3, machine) + bytes(44)


def files(driver: str, device: str) -> Files:
    return {"captain.toml": f'[interfaces.air]\ndriver = "{driver}"\ndevice = "{device}"\n', "authorized_keys": KEY}


def udp(option: str) -> Files:
    return {"captain.toml": f'[interfaces.air]\ndriver = "udp"\n{option}\n', "authorized_keys": KEY}


def radio(library: str, content: bytes | None, **more: str) -> Files:
    """A SOM301-E, and its library on the card."""
    given: Files = {"captain.toml": RADIO.replace("lib/radio.so", library), "authorized_keys": KEY}
    given |= {name.replace("_", "."): text for name, text in more.items()}
    return given if content is None else given | {"lib/radio.so": content}


def cell(folder: str) -> Files:
    text = f'[interfaces.cell]\ndriver = "sim8202g"\nusb = "1-1.4"\nstate_dir = "{folder}"\n'
    return {"captain.toml": text, "authorized_keys": KEY}


def receiver(port: str, more: str = "") -> Files:
    text = f'[interfaces.place]\ndriver = "zed_f9p"\nport = "{port}"\n{more}'
    return {"captain.toml": text, "authorized_keys": KEY}


BOX_64, BOX_PC = library(183), library(62)  # ELF's machines: aarch64, x86-64
WIFI = '[wifi]\ncountry = "DE"\nssid = "depot"\n'
PLACE = "captain.toml:3 interfaces.air"
SURVEYED = 'kind = "static"\nlatitude = 48.1\nlongitude = 11.6\n'
# Files, places and keys of their mistakes, those of remarks, and what both name.
DEVICES: list[tuple[Files, list[str], list[str], list[str]]] = [
    # frames at the networks of ssh and of users
    (files("ethernet", "eth0"), [], [f"{PLACE}.device"], ["eth0"]),
    (files("ethernet", "usb0"), [], [], []),
    (files("ethernet", "wlan0"), [], [], []),
    (files("ethernet", "wlan0") | {"box.toml": WIFI}, [], [f"{PLACE}.device"], ["wlan0"]),
    # a module in the network of eth0 is reached by no way
    (radio("lib/radio.so", BOX_64, box_toml='[eth0]\naddress = "192.168.1.20/24"\n'), ["captain.toml:4 interfaces.air.ip"], [],
     ["192.168.1.3", "192.168.1.20/24", "eth0"]),
    (radio("lib/radio.so", BOX_64, box_toml='[eth0]\naddress = "10.0.0.20/24"\n'), [], [], []),
    # libraries
    (radio("lib/radio.so", BOX_64), [], [], []),
    (radio("lib/radio.so", BOX_64 + bytes(1 << 20)), [], [], []),
    (radio("lib/radio.so", BOX_PC), [f"{PLACE}.library"], [], ["x86-64", "aarch64"]),
    (radio("lib/radio.so", b"MZ\x90\0"), [f"{PLACE}.library"], [], ["4d 5a 90 00"]),
    (radio("lib/radio.so", None), [f"{PLACE}.library"], [], ["lib/radio.so", "lib/,"]),
    (radio("radio.so", BOX_64), [], [], []),
    (radio("radio.so", BOX_PC), [f"{PLACE}.library"], [], ["aarch64"]),
    (radio("radio.so", None), [], [], []),
    (radio("/usr/lib/radio.so", BOX_64), [f"{PLACE}.library"], ["lib/radio.so"], ["/usr/lib/radio.so", 'library = "lib/radio.so"']),
    # what the firewall lets in
    (udp('listen = "0.0.0.0:9001"'), [], [f"{PLACE}.listen"], ["0.0.0.0:9001"]),
    (udp('group = "239.118.122.97:8947"'), [], [f"{PLACE}.group"], ["239.118.122.97:8947"]),
    (udp('listen = "192.0.2.7:9001"'), [], [f"{PLACE}.listen"], ["192.0.2.7:9001"]),
    (udp('listen = "127.0.0.1:9001"'), [], [], []),
    (udp('peers = ["192.0.2.7:9001"]'), [], [], []),
    # serial ports
    (files("uart", "/dev/ttyS1"), [f"{PLACE}.device"], [], ["/dev/ttyS1", "/dev/ttyUSB0"]),
    (files("uart", "/dev//ttyS1"), [f"{PLACE}.device"], [], ["/dev/ttyS1"]),
    (receiver("/dev/ttyS1"), ["captain.toml:3 interfaces.place.port"], [], ["/dev/ttyS1"]),
    (receiver("COM3", SURVEYED), [], [], []),
    (files("uart", "/dev/ttyS0"), [], [f"{PLACE}.device"], ["/dev/ttyUSB0"]),
    (files("uart", "/dev/ttyAMA0"), [], [f"{PLACE}.device"], ["/dev/ttyUSB0"]),
    (files("uart", "/dev/ttyUSB0"), [], [], []),
    *((files("uart", name), [f"{PLACE}.device"], [], [f'"{name}"', "/dev/ttyUSB0"]) for name in ("COM3", "ttyUSB0", "eth0", "../tty")),
    # where the station may write
    (cell("/home/me"), [], ["captain.toml:4 interfaces.cell.state_dir"], ["/home/me"]),
    (cell("pins"), [], ["captain.toml:4 interfaces.cell.state_dir"], ["pins"]),
    (cell("/var/lib/captain"), [], [], []),
    (cell("/var/lib/captain/cell/"), [], [], []),
]  # fmt: skip


@pytest.mark.parametrize(("given", "wrong", "told", "values"), DEVICES)
def test_interface_at_what_a_box_has_itself_is_refused_or_told(
    look: Look, given: Files, wrong: list[str], told: list[str], values: list[str]
):
    found = look(given)
    assert (refused(found), noted(found)) == (wrong, told)
    said = "\n".join(note.text for note in found.notes)
    assert [value for value in values if value not in said] == []


def test_library_on_the_card_is_kept_octet_for_octet(look: Look):
    assert look(radio("lib/radio.so", BOX_64)).files["lib/radio.so"] == BOX_64


def test_console_that_is_kept_is_that_of_the_image():
    assert f"/dev/{read(OVERLAY.parent / 'image.toml').console.device}" == devices.CONSOLE
