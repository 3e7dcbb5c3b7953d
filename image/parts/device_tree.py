"""Device tree of the board: the kernel's, changed by the build."""

from pathlib import Path
from typing import Any, NamedTuple

from board.pi import overlays as pi
from board.runtime.errors import ConfigurationError
from board.runtime.toml import load
from image.description import DeviceTree
from image.errors import ImageError
from image.tool import run

GPIO = "/soc/gpio@7e200000"


class Block(NamedTuple):
    """Block of the chip that uses two pins. node: its own node; pins: node of its pins."""

    node: str
    pins: str


# BCM2711 ARM Peripherals, 2022-01-18, 5.3 (alternative functions); names of nodes as in Linux 6.12.
I2C = {
    1: Block("/soc/i2c@7e804000", "i2c1-gpio2"),
    3: Block("/soc/i2c@7e205600", "i2c3-gpio4"),
    4: Block("/soc/i2c@7e205800", "i2c4-gpio8"),
    5: Block("/soc/i2c@7e205a00", "i2c5-gpio12"),
    6: Block("/soc/i2c@7e205c00", "i2c6-gpio22"),
}
UARTS = {
    2: Block("/soc/serial@7e201400", "uart2-gpio0"),
    3: Block("/soc/serial@7e201600", "uart3-gpio4"),
    4: Block("/soc/serial@7e201800", "uart4-gpio8"),
    5: Block("/soc/serial@7e201a00", "uart5-gpio12"),
}
CONSOLE = "enable_uart=1"
PI = 4  # the generation whose blocks are in I2C and UARTS

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
    """Check that the device tree will have the devices that a board file names.

    Raises ImageError with the entry that [device_tree] lacks.
    """
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
    """Read the tables of a board file. Raises ImageError if it is unknown or invalid."""
    try:
        return load(path)
    except ConfigurationError as error:
        raise ImageError(f"device_tree.board: {error.message}", "see board/boards") from error


def additions(tree: DeviceTree, source: str) -> str:
    """Return the text to append to a tree's source. It names nodes by path, because the tree may lack symbols.

    source  source of the tree; blocks that its chip lacks are left out, as a Pi 3 has fewer.

    Raises ImageError for a number in [device_tree] that no chip has, or a GPIO that is used twice.
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
    """Return lines of config.txt that make the firmware add the devices. Raises ImageError for a GPIO used twice."""
    _no_pin_twice(tree)
    pulse = [pi.pulse(tree.pulse_gpio)] if tree.pulse_gpio is not None else []
    uarts = (line for number in tree.uarts for line in pi.uart(f"ttyAMA{number}", PI))
    return [*pulse, *(pi.i2c(number, PI) for number in tree.i2c), *uarts]


def compiled(tree: DeviceTree, source: Path, target: Path) -> None:
    """Compile a device tree with the additions."""
    text = run(["dtc", "-q", "-I", "dtb", "-O", "dts", source])
    run(["dtc", "-q", "-I", "dts", "-O", "dtb", "-o", target, "-"], given=text + additions(tree, text))


def _known(blocks: dict[int, Block], number: int, name: str) -> Block:
    if number not in blocks:
        raise ImageError(f"device_tree.{name}: {number} is not one of {', '.join(map(str, blocks))}")
    return blocks[number]


def _no_pin_twice(tree: DeviceTree) -> None:
    for number in tree.i2c:
        _known(I2C, number, "i2c")
    for uart in tree.uarts:
        _known(UARTS, uart, "uarts")
    users = {CONSOLE: "the console"}
    users |= {pi.i2c(number, PI): f"i2c {number}" for number in tree.i2c}
    users |= {line: f"uart {number}" for number in tree.uarts for line in pi.uart(f"ttyAMA{number}", PI)}
    if tree.pulse_gpio is not None:
        users[pi.pulse(tree.pulse_gpio)] = "the pulse"
    if twice := pi.used_twice(users):
        gpio, *names = twice
        raise ImageError(f"device_tree: GPIO {gpio} is taken by {' and by '.join(names)}")
