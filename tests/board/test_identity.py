"""Identity of the board: HAT EEPROM with CRC, and device tree."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from board.identity import ENOUGH, Identity, crc16, of_device_tree, of_eeprom
from board.runtime.errors import ProtocolError
from drivers.sim.registers import hat_image

UUID = "00112233-4455-6677-8899-aabbccddeeff"
IMAGE = hat_image("Example Ltd", "Quad", 0x1234, 0x0002, UUID)


def test_a_hat_is_who_its_vendor_atom_says():
    assert of_eeprom(IMAGE, "here") == Identity("Example Ltd", "Quad", "0x1234", "0x0002", UUID, "here")


def test_octets_of_a_vendor_atom_in_their_places():
    # Written by hand from the format's description: the uuid with its least significant octet first.
    atom = bytes.fromhex("0100 0000 1c000000 ffeeddccbbaa99887766554433221100 3412 0200 02 02") + b"AbCd"
    octets = b"R-Pi" + bytes.fromhex("01 00 0100 30000000") + atom + crc16(atom).to_bytes(2, "little")
    assert of_eeprom(octets, "")[:5] == ("Ab", "Cd", "0x1234", "0x0002", UUID)


def test_the_crc_is_that_of_the_check_string():
    assert crc16(b"123456789") == 0xBB3D


def test_what_follows_the_vendor_atom_is_not_needed():
    assert len(IMAGE) <= ENOUGH
    assert of_eeprom(IMAGE + bytes(100), "here") == of_eeprom(IMAGE, "here")
    longest = hat_image("v" * 255, "p" * 255, 1, 1, UUID)
    assert len(longest) == ENOUGH
    assert of_eeprom(longest, "").vendor == "v" * 255


def test_a_blank_eeprom_is_said_to_hold_no_image():
    with pytest.raises(ProtocolError, match="0x50: begins with ff ff ff ff, not with R-Pi"):
        of_eeprom(b"\xff" * ENOUGH, "0x50")


@given(place=st.integers(12, len(IMAGE) - 1), bit=st.integers(0, 7))
def test_one_wrong_bit_in_the_atom_is_found(place, bit):
    octets = bytearray(IMAGE)
    octets[place] ^= 1 << bit
    with pytest.raises(ProtocolError, match=r"first atom|does not fit"):
        of_eeprom(bytes(octets), "0x50")


def test_a_wrong_crc_is_said_with_both():
    octets = IMAGE[:-2] + b"\0\0"
    with pytest.raises(ProtocolError, match=r"is 0x[0-9a-f]{4} and stored as 0x0000"):
        of_eeprom(octets, "0x50")


@given(length=st.integers(0, len(IMAGE) - 1))
def test_an_image_that_ends_early_is_refused(length):
    with pytest.raises(ProtocolError):
        of_eeprom(IMAGE[:length], "0x50")


@given(st.binary(max_size=ENOUGH), st.integers(0, len(IMAGE)))
def test_random_octets_are_refused_or_an_identity_that_can_be_printed(octets, kept):
    try:
        found = of_eeprom(IMAGE[:kept] + octets, "0x50")
    except ProtocolError as error:
        assert "0x50" in error.message
    else:
        assert all(word.isprintable() for word in found)


@given(names=st.binary(max_size=40), split=st.integers(0, 40))
def test_names_are_printable_ascii_whatever_was_stored(names, split):
    split = min(split, len(names))
    data = bytes(20) + bytes([split, len(names) - split]) + names
    atom = bytes([1, 0, 0, 0]) + (len(data) + 2).to_bytes(4, "little") + data
    octets = b"R-Pi\1\0\1\0\0\0\0\0" + atom + crc16(atom).to_bytes(2, "little")
    found = of_eeprom(octets, "0x50")
    assert (found.vendor + found.product).isascii()
    assert (found.vendor + found.product).isprintable()


@pytest.mark.parametrize(("change", "words"), [
    (lambda octets: octets[:4] + b"\2" + octets[5:], "version 2"),
    (lambda octets: octets[:6] + b"\0\0" + octets[8:], "has no atom"),
    (lambda octets: octets[:12] + b"\2\0" + octets[14:], "type 2"),
])  # fmt: skip
def test_another_format_is_named(change, words):
    with pytest.raises(ProtocolError, match=words):
        of_eeprom(change(IMAGE), "0x50")


# device tree


@pytest.mark.parametrize("folder", ["hat", "hat-0"])
def test_what_the_firmware_has_read_is_taken_from_the_device_tree(tmp_path, folder):
    directory = tmp_path / "device-tree" / folder
    directory.mkdir(parents=True)
    for name, octets in {
        "vendor": b"Example Ltd\0",
        "product": b"Quad\0",
        "product_id": b"0x1234\0",
        "uuid": b"1-2\0",
    }.items():
        (directory / name).write_bytes(octets)
    assert of_device_tree(tmp_path) == Identity("Example Ltd", "Quad", "0x1234", "", "1-2", str(directory))


def test_a_board_without_an_eeprom_has_no_identity(tmp_path):
    assert of_device_tree(tmp_path) is None
    (tmp_path / "device-tree/hat").mkdir(parents=True)
    assert of_device_tree(tmp_path) is None
