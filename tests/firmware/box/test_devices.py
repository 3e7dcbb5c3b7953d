"""Interfaces of captain.toml at what the owner reaches his box by."""

import pytest

from firmware.box import station
from image.description import read
from tests.firmware.box.conftest import KEY, OVERLAY, Files, Look, mistakes, remarks


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


def test_the_console_of_the_image_is_the_one_that_is_kept():
    assert f"/dev/{read(OVERLAY.parent / 'image.toml').console.device}" == station.CONSOLE


@pytest.mark.parametrize("name", ["OPENSSH PRIVATE KEY", "RSA PRIVATE KEY", "EC PRIVATE KEY", "ENCRYPTED PRIVATE KEY"])
def test_a_private_key_among_the_public_ones_is_named_and_never_shown(look: Look, name: str):
    found = look({"authorized_keys": f"-----BEGIN {name}-----\nc2VjcmV0c2VjcmV0\n-----END {name}-----\n{KEY}\n"})
    assert not found.is_accepted
    assert [text.partition(",")[0] for text in mistakes(found)] == ["authorized_keys:1: is a private key"]
    assert not any("c2VjcmV0" in note.text for note in found.notes)
