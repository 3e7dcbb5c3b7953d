"""Verifies a device tree: pulse pin, buses and console."""

from collections.abc import Callable, Iterator
from pathlib import Path

from image.description import Description
from image.errors import ImageError
from image.parts.device_tree import GPIO, I2C, UARTS
from image.tool import run

# Nodes of the Pi's serial ports by the kernel's name of the console. Source: Linux 6.12, bcm283x-rpi-*.dtsi, aliases.
CONSOLES = {"ttyS0": "serial1", "ttyS1": "serial1", "ttyAMA0": "serial0"}

# Reads words of a property by node, name and kind (s: text, i: integers); empty if it is absent.
Get = Callable[[str, str, str], list[str]]


def reader(tree: Path) -> Get:
    """Return a function that reads a compiled tree."""

    def get(node: str, name: str, kind: str) -> list[str]:
        try:
            return run(["fdtget", "-t", kind, tree, node, name]).split()
        except ImageError:  # fdtget ends with 1 if the node or property is absent
            return []

    return get


def troubles(description: Description, get: Get) -> Iterator[str]:
    """Yield devices that the board needs and a tree lacks, in words."""
    wanted = description.device_tree
    if wanted.pulse_gpio is not None:
        yield from _pulse(get, wanted.pulse_gpio)
    for word, blocks, numbers in (("i2c", I2C, wanted.i2c), ("serial", UARTS, wanted.uarts)):
        for number in numbers:
            block = blocks[number]
            if not get(block.node, "compatible", "s"):
                continue  # the chip lacks this block: a Pi 3 has fewer than a Pi 4
            yield from _is(get, "/aliases", f"{word}{number}", block.node)
            yield from _is(get, block.node, "status", "okay")
            pins = get(f"{GPIO}/{block.pins}", "phandle", "i")
            yield from _is(get, block.node, "pinctrl-0", *pins, kind="i")
    console = get("/aliases", CONSOLES.get(description.console.device, ""), "s")
    if not console:
        yield f"console {description.console.device} is missing"
    else:
        yield from _is(get, console[0], "status", "okay")


def _pulse(get: Get, pin: int) -> Iterator[str]:
    yield from _is(get, "/pps", "compatible", "pps-gpio")
    yield from _is(get, "/pps", "gpios", *get(GPIO, "phandle", "i"), str(pin), "0", kind="i")
    pins = f"{GPIO}/pps-pins"
    yield from _is(get, "/pps", "pinctrl-0", *get(pins, "phandle", "i"), kind="i")
    for name, value in (("brcm,pins", str(pin)), ("brcm,function", "0"), ("brcm,pull", "0")):
        yield from _is(get, pins, name, value, kind="i")


def _is(get: Get, node: str, name: str, *value: str, kind: str = "s") -> Iterator[str]:
    found = get(node, name, kind)
    if found != list(value) or not value:
        yield f"{node} {name}: {' '.join(found) or 'is missing'}, not {' '.join(value) or 'its target'}"
