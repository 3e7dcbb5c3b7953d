"""Queries of a compiled device tree."""

import dataclasses
from pathlib import Path

import pytest

from image.description import read
from image.verify.tree import troubles

OWN = read(Path(__file__).resolve().parents[3] / "image/image.toml")
GPIO, I2C, UART = "/soc/gpio@7e200000", "/soc/i2c@7e804000", "/soc/serial@7e215040"
# As fdtget reads the tree of a Pi 4 that was made for the board `quad`.
PI4 = {
    ("/pps", "compatible"): "pps-gpio",
    ("/pps", "gpios"): "6 18 0",
    ("/pps", "pinctrl-0"): "77",
    (GPIO, "phandle"): "6",
    (f"{GPIO}/pps-pins", "phandle"): "77",
    (f"{GPIO}/pps-pins", "brcm,pins"): "18",
    (f"{GPIO}/pps-pins", "brcm,function"): "0",
    (f"{GPIO}/pps-pins", "brcm,pull"): "0",
    (f"{GPIO}/i2c1-gpio2", "phandle"): "30",
    (I2C, "compatible"): "brcm,bcm2711-i2c brcm,bcm2835-i2c",
    (I2C, "status"): "okay",
    (I2C, "pinctrl-0"): "30",
    ("/aliases", "i2c1"): I2C,
    ("/aliases", "serial1"): UART,
    (UART, "status"): "okay",
}


def told(tree: dict[tuple[str, str], str], **wanted: object) -> list[str]:
    chosen = dataclasses.replace(OWN, device_tree=dataclasses.replace(OWN.device_tree, **wanted))  # type: ignore[arg-type]
    return list(troubles(chosen, lambda node, name, kind: tree.get((node, name), "").split()))


def test_the_tree_of_the_board_has_all_it_needs():
    assert told(PI4) == []


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (("/pps", "compatible"), "", "/pps compatible: is missing, not pps-gpio"),
        (("/pps", "gpios"), "6 4 0", "/pps gpios: 6 4 0, not 6 18 0"),
        ((f"{GPIO}/pps-pins", "brcm,pins"), "4", f"{GPIO}/pps-pins brcm,pins: 4, not 18"),
        ((I2C, "status"), "disabled", f"{I2C} status: disabled, not okay"),
        (("/aliases", "i2c1"), "", f"/aliases i2c1: is missing, not {I2C}"),
        ((UART, "status"), "disabled", f"{UART} status: disabled, not okay"),
        (("/aliases", "serial1"), "", "console ttyS1 is missing"),
    ],
)
def test_what_is_not_as_the_board_needs_it_is_told(place: tuple[str, str], value: str, said: str):
    assert told(PI4 | {place: value}) == [said]


def test_a_block_that_the_chip_does_not_have_is_not_missed():
    assert told(PI4, uarts=(3,)) == []


def test_a_board_without_a_pulse_needs_no_node_for_it():
    tree = {place: value for place, value in PI4.items() if "pps" not in place[0]}
    assert told(tree, pulse_gpio=None) == []
