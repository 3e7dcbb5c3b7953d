"""Additions to the kernel's device tree."""

import dataclasses
from pathlib import Path

import pytest

from image.description import DeviceTree, read
from image.errors import ImageError
from image.parts import device_tree

OWN = read(Path(__file__).resolve().parents[3] / "image/image.toml").device_tree
# As dtc writes a tree of a Pi 4, of which a Pi 3's has no uart3.
PI3 = "\t\ti2c@7e804000 {\n\t\t\ti2c1-gpio2 {\n"
PI4 = PI3 + "\t\tserial@7e201600 {\n\t\t\tuart3-gpio4 {\n"


def tree(**values: object) -> DeviceTree:
    return dataclasses.replace(OWN, **values)  # type: ignore[arg-type]


def test_a_pulse_is_a_node_of_pps_gpio_at_its_pin():
    said = device_tree.additions(tree(pulse_gpio=18, i2c=()), "")
    assert 'compatible = "pps-gpio"' in said
    assert "brcm,pins = <18>" in said
    assert "gpios = <&{/soc/gpio@7e200000} 18 0>" in said


def test_a_bus_gets_its_pins_and_the_number_of_its_device():
    said = device_tree.additions(tree(pulse_gpio=None, i2c=(1,)), PI4)
    assert '&{/soc/i2c@7e804000} { pinctrl-names = "default"; pinctrl-0 = <&{/soc/gpio@7e200000/i2c1-gpio2}>' in said
    assert 'i2c1 = "/soc/i2c@7e804000"' in said


def test_a_block_that_the_chip_does_not_have_is_left_out():
    wanted = tree(pulse_gpio=None, i2c=(), uarts=(3,))
    assert "serial@7e201600" in device_tree.additions(wanted, PI4)
    assert device_tree.additions(wanted, PI3) == ""


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"pulse_gpio": 14}, "GPIO 14 is taken by the console and by the pulse"),
        ({"pulse_gpio": 2}, "GPIO 2 is taken by i2c 1 and by the pulse"),
        ({"i2c": (3,), "uarts": (3,)}, "GPIO 4 is taken by i2c 3 and by uart 3"),
        ({"i2c": (0,)}, "device_tree.i2c: 0 is not one of 1, 3, 4, 5, 6"),
    ],
)
def test_a_pin_that_is_taken_twice_is_told(values: dict[str, object], said: str):
    for way in (lambda wanted: device_tree.additions(wanted, PI4), device_tree.overlays):
        with pytest.raises(ImageError, match=said):
            way(tree(**values))


def test_the_firmware_is_asked_for_the_same_where_it_makes_the_tree():
    assert device_tree.overlays(tree(uarts=(4,))) == [
        "dtoverlay=pps-gpio,gpiopin=18",
        "dtparam=i2c_arm=on",
        "dtoverlay=uart4",
    ]


def test_pulse_of_the_card_is_at_the_gpio_of_its_board_file():
    board = device_tree.read_board(Path(__file__).resolve().parents[3] / f"board/boards/{OWN.board}.toml")
    assert board["pulse"]["gpio"] == OWN.pulse_gpio
