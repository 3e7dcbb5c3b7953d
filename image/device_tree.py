"""The board's device tree: the kernel's own, with what the board needs added when the image is built."""

import tomllib
from pathlib import Path
from typing import Any, NamedTuple

from image.description import DeviceTree
from image.errors import ImageError
from image.program import run

GPIO = "/soc/gpio@7e200000"


class Block(NamedTuple):
    """A block of the chip that takes two pins. node: its own; pins: the node of its pins; gpios: which these are."""

    node: str
    pins: str
    gpios: tuple[int, int]


# BCM2711 ARM Peripherals, 2022-01-18, 5.3 (alternative functions); nodes as Linux 6.12 has them.
I2C = {
    1: Block("/soc/i2c@7e804000", "i2c1-gpio2", (2, 3)),
    3: Block("/soc/i2c@7e205600", "i2c3-gpio4", (4, 5)),
    4: Block("/soc/i2c@7e205800", "i2c4-gpio8", (8, 9)),
    5: Block("/soc/i2c@7e205a00", "i2c5-gpio12", (12, 13)),
    6: Block("/soc/i2c@7e205c00", "i2c6-gpio22", (22, 23)),
}
UARTS = {
    2: Block("/soc/serial@7e201400", "uart2-gpio0", (0, 1)),
    3: Block("/soc/serial@7e201600", "uart3-gpio4", (4, 5)),
    4: Block("/soc/serial@7e201800", "uart4-gpio8", (8, 9)),
    5: Block("/soc/serial@7e201a00", "uart5-gpio12", (12, 13)),
}
CONSOLE_GPIOS = (14, 15)

_PULSE = """\
&{{{gpio}}} {{ pps_pins: pps-pins {{ brcm,pins = <{pin}>; brcm,function = <0>; brcm,pull = <0>; }}; }};
&{{/}} {{ pps {{
    compatible = "pps-gpio"; pinctrl-names = "default"; pinctrl-0 = <&pps_pins>; gpios = <&{{{gpio}}} {pin} 0>;
}}; }};
"""
_BLOCK = """\
&{{{node}}} {{ pinctrl-names = "default"; pinctrl-0 = <&{{{gpio}/{pins}}}>; status = "okay"; }};
&{{/aliases}} {{ {alias} = "{node}"; }};
"""


def wanted_by(board: dict[str, Any], tree: DeviceTree) -> None:
    """Whether the tree will have what a board file asks for. Raises ImageError: what is missing in [device_tree]."""
    wants_pulse = str(board.get("pulse", {}).get("device", "")).startswith("/dev/pps")
    if wants_pulse and tree.pulse_gpio is None:
        raise ImageError(
            f"device_tree.pulse_gpio: is missing, and board {tree.board} has pulse.device {board['pulse']['device']!r}",
            "the GPIO that the receiver's time pulse is wired to: pulse_gpio = 18",
        )
    for name, bus in board.get("buses", {}).items():
        path = str(bus.get("path", ""))
        number = path.removeprefix("/dev/i2c-")
        if path != number and number.isdecimal() and int(number) not in tree.i2c:
            raise ImageError(
                f"device_tree.i2c: {list(tree.i2c)} lacks {number}, which is buses.{name} of board {tree.board}"
            )


def read_board(path: Path) -> dict[str, Any]:
    """The tables of a board file. Raises ImageError."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ImageError(f"device_tree.board: {path}: cannot be read: {error.strerror}", "see board/boards") from error
    except ValueError as error:
        raise ImageError(f"device_tree.board: {path}: is not TOML: {error}") from error


def additions(tree: DeviceTree, source: str) -> str:
    """What is appended to a tree's source: nodes are named by path, so that it need not have symbols.

    source  of the tree; a block that its chip does not have (a Pi 3 has fewer) is left out.
    """
    _no_pin_twice(tree)
    blocks = [
        *((f"i2c{number}", _known(I2C, number, "i2c")) for number in tree.i2c),
        *((f"serial{number}", _known(UARTS, number, "uarts")) for number in tree.uarts),
    ]
    found = [_PULSE.format(gpio=GPIO, pin=tree.pulse_gpio)] if tree.pulse_gpio is not None else []
    for alias, block in blocks:
        if f"\t{block.node.removeprefix('/soc/')} {{" in source and f"\t{block.pins} {{" in source:
            found.append(_BLOCK.format(node=block.node, gpio=GPIO, pins=block.pins, alias=alias))
    return "".join(found)


def overlays(tree: DeviceTree) -> list[str]:
    """The same as lines of config.txt, where the firmware does it."""
    _no_pin_twice(tree)
    pulse = [f"dtoverlay=pps-gpio,gpiopin={tree.pulse_gpio}"] if tree.pulse_gpio is not None else []
    i2c = ["dtparam=i2c_arm=on" if number == 1 else f"dtoverlay=i2c{number}" for number in tree.i2c]
    return [*pulse, *i2c, *(f"dtoverlay=uart{number}" for number in tree.uarts)]


def compiled(tree: DeviceTree, source: Path, target: Path) -> None:
    """A device tree with the additions."""
    text = run(["dtc", "-q", "-I", "dtb", "-O", "dts", source])
    run(["dtc", "-q", "-I", "dts", "-O", "dtb", "-o", target, "-"], given=text + additions(tree, text))


def _known(blocks: dict[int, Block], number: int, name: str) -> Block:
    if number not in blocks:
        raise ImageError(f"device_tree.{name}: {number} is none of {', '.join(map(str, blocks))}")
    return blocks[number]


def _no_pin_twice(tree: DeviceTree) -> None:
    taken = dict.fromkeys(CONSOLE_GPIOS, "the console")
    users: list[tuple[str, tuple[int, ...]]] = [
        *((f"i2c {number}", _known(I2C, number, "i2c").gpios) for number in tree.i2c),
        *((f"uart {number}", _known(UARTS, number, "uarts").gpios) for number in tree.uarts),
        *([("the pulse", (tree.pulse_gpio,))] if tree.pulse_gpio is not None else []),
    ]
    for user, gpios in users:
        for gpio in gpios:
            if gpio in taken:
                raise ImageError(f"device_tree: GPIO {gpio} is taken by {taken[gpio]} and by {user}")
            taken[gpio] = user
