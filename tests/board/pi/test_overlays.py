"""Lines of config.txt, by the model of a Raspberry Pi."""

import pytest

from board.pi import overlays


@pytest.mark.parametrize(
    ("model", "pi"),
    [
        ("Raspberry Pi 4 Model B Rev 1.4", 4),
        ("Raspberry Pi 400 Rev 1.0", 4),
        ("Raspberry Pi Compute Module 4 Rev 1.1", 4),
        ("Raspberry Pi 5 Model B Rev 1.0", 5),
        ("Raspberry Pi 500 Rev 1.0", 5),
        ("Raspberry Pi Compute Module 5 Rev 1.0", 5),
        ("Raspberry Pi 3 Model B Plus Rev 1.3", 3),
        ("Raspberry Pi Zero 2 W Rev 1.0", 2),
        ("Raspberry Pi Zero W Rev 1.1", 1),
        ("linux,dummy-virt", 0),
        ("", 0),
    ],
)
def test_generation_is_that_of_the_models_chip(model: str, pi: int):
    assert overlays.generation(model) == pi


@pytest.mark.parametrize(
    ("model", "pi", "names"),
    [
        ("Raspberry Pi 4 Model B Rev 1.4", 4, ("all", "pi4")),
        ("Raspberry Pi 400 Rev 1.0", 4, ("all", "pi4", "pi400")),
        ("Raspberry Pi Compute Module 4 Rev 1.1", 4, ("all", "pi4", "cm4")),
        ("Raspberry Pi Compute Module 5 Rev 1.0", 5, ("all", "pi5", "cm5")),
        ("Raspberry Pi 500 Rev 1.0", 5, ("all", "pi5", "pi500")),
        ("Raspberry Pi 500 Rev 1.0", 4, ("all", "pi4")),
        ("linux,dummy-virt", 5, ("all", "pi5")),
    ],
)
def test_filters_are_those_of_generation_and_model(model: str, pi: int, names: tuple[str, ...]):
    assert overlays.filters(model, pi) == names


def test_every_line_of_a_bus_or_port_has_its_gpios():
    made = {overlays.i2c(number, pi) for number in range(10) for pi in (4, 5)} - {""}
    made |= {line for number in range(10) for pi in (4, 5) for line in overlays.uart(f"ttyAMA{number}", pi)}
    assert made - {"dtoverlay=miniuart-bt"} == set(overlays.GPIOS)


@pytest.mark.parametrize(
    ("number", "four", "five"),
    [
        (0, "dtparam=i2c_vc=on", "dtoverlay=i2c0-pi5"),
        (1, "dtparam=i2c_arm=on", "dtparam=i2c_arm=on"),
        (2, "", "dtoverlay=i2c2-pi5"),
        (3, "dtoverlay=i2c3", "dtoverlay=i2c3-pi5"),
        (6, "dtoverlay=i2c6", ""),
        (20, "", ""),
    ],
)
def test_bus_has_the_overlay_of_its_chip(number: int, four: str, five: str):
    assert overlays.i2c(number, 4) == four
    assert overlays.i2c(number, 5) == five


@pytest.mark.parametrize(
    ("device", "three", "four", "five"),
    [
        ("ttyAMA0", ["enable_uart=1", "dtoverlay=miniuart-bt"], ["enable_uart=1", "dtoverlay=miniuart-bt"], ["dtoverlay=uart0-pi5"]),
        ("ttyS0", ["enable_uart=1"], ["enable_uart=1"], []),
        ("serial0", ["enable_uart=1"], ["enable_uart=1"], []),
        ("ttyAMA3", [], ["dtoverlay=uart3"], ["dtoverlay=uart3-pi5"]),
        ("ttyAMA5", [], ["dtoverlay=uart5"], []),
        ("ttyAMA10", [], [], []),
        ("ttyUSB0", [], [], []),
    ],
)  # fmt: skip
def test_serial_port_has_the_overlay_of_its_chip(device: str, three: list[str], four: list[str], five: list[str]):
    assert [overlays.uart(device, pi) for pi in (3, 4, 5)] == [three, four, five]
