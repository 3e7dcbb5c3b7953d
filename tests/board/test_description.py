"""Board files: what a slot may say of USB."""

import pytest

from board.description import SlotDescription
from board.runtime.describe import read
from board.runtime.errors import ConfigurationError


def slot(**keys):
    return read(SlotDescription, keys, "board.toml", "slots.5g")


def test_a_slot_is_read_with_its_place_and_ids():
    assert slot(usb="1-1.3", ids=["1e0e:9001", "1e0e:9011"]).ids == ("1e0e:9001", "1e0e:9011")
    assert slot() == SlotDescription()


@pytest.mark.parametrize("text", ["1-1,3", "usb1", "/dev/ttyUSB2"])
def test_a_place_that_usb_does_not_have_is_a_mistake_of_the_file(text):
    with pytest.raises(ConfigurationError) as caught:
        slot(usb=text)
    assert "board.toml: slots.5g" in caught.value.message
    assert repr(text) in caught.value.message


@pytest.mark.parametrize("text", ["1e0e", "1E0E:9001", "0x1e0e:0x9001", "1e0e:9001 "])
def test_an_id_that_no_device_can_have_is_a_mistake_of_the_file(text):
    with pytest.raises(ConfigurationError, match="invalid id of a USB device"):
        slot(usb="1-1.3", ids=[text])
