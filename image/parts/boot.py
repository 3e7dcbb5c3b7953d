"""Boot partition: firmware, U-Boot, its script, device trees, and editable files."""

import shutil
from pathlib import Path

from image.description import Description, DeviceTree
from image.errors import ImageError
from image.parts import device_tree
from image.parts.kernel import Kernel
from image.tool import run

SCRIPT = Path(__file__).parents[1] / "boot.cmd"
FILES = Path(__file__).parents[1] / "first"  # files that are copied unchanged
LOADER = "u-boot.bin"
OVERLAYS = "overlays"  # folder in the kernel's package and on the partition; dtoverlay= and dtparam= name its files

_CONFIG = """\
# Read by the Pi's firmware. Written when the image was built.
arm_64bit=1
kernel={loader}
upstream_kernel={is_upstream:d}
# The mini UART, header pins 8 and 10, is the console; its clock must not follow the processor's.
enable_uart=1
disable_splash=1
{lines}
[pi4]
device_tree={tree_pi4}
[pi3]
device_tree={tree_pi3}
[all]
"""


def script(description: Description) -> str:
    """Return the text of the boot script for this card."""
    console = description.console
    words = {
        "@CONSOLE@": f"{console.device},{console.baud}",
        "@LABEL@": f"{description.disk.label_id:08x}",
        "@COMMAND_LINE@": description.kernel.command_line,
    }
    text = SCRIPT.read_text()
    for word, value in words.items():
        text = text.replace(word, value)
    return text


def config(description: Description) -> str:
    """Return config.txt. Source: Raspberry Pi documentation, config.txt; raspi-firmware's README.Debian."""
    tree = description.device_tree
    by_firmware = device_tree.overlays(tree) if tree.way == "overlays" else []
    pi4 = next((name for name in tree.files if name.startswith("bcm2711")), "")
    pi3 = next((name for name in tree.files if name.startswith(("bcm2837", "bcm2710"))), "")
    return _CONFIG.format(
        loader=LOADER, is_upstream=tree.way == "dtc", lines="\n".join(by_firmware), tree_pi4=pi4, tree_pi3=pi3
    )


def make(description: Description, kernel: Kernel, board: Path, folder: Path) -> None:
    """Put the partition's files into a folder. board: path of the board file.

    Raises ImageError if a file that the description names is not in its package.
    """
    device_tree.wanted_by(device_tree.read_board(board), description.device_tree)
    shutil.copytree(FILES, folder)
    firmware, loader = description.firmware, description.loader
    for name in firmware.files:
        shutil.copy(_packed(kernel, "firmware.files", f"{firmware.folder}/{name}", firmware.package), folder / name)
    shutil.copy(_packed(kernel, "loader.file", loader.file, loader.package), folder / LOADER)
    trees(description.device_tree, kernel, folder)
    (folder / "config.txt").write_text(config(description))
    text = folder.parent / "boot.cmd"
    text.write_text(script(description))
    run(
        ["mkimage", "-q", "-A", "arm64", "-T", "script", "-n", "slots", "-d", text, folder / "boot.scr"],
        environment={"SOURCE_DATE_EPOCH": "0"},
    )


def _packed(kernel: Kernel, key: str, path: str, package: str) -> Path:
    source = kernel.folder / path
    if not source.is_file():
        raise ImageError(f"{key}: {path}: is not in {package}", f"{source.parent} has those that are")
    return source


def trees(tree: DeviceTree, kernel: Kernel, folder: Path) -> None:
    """Put the device trees into a folder: compiled with additions, or unchanged with overlays for the firmware.

    Raises ImageError if a file is not in its package.
    """
    for name in tree.files:
        source = kernel.device_tree(tree.folder, name)
        if not source.is_file():
            what = f"device_tree.files: {tree.folder}/{name}: is not in the kernel of {kernel.version}"
            raise ImageError(what, f"{source.parent} has those that are")
        if tree.way == "dtc":
            device_tree.compiled(tree, source, folder / name)
        else:
            shutil.copy(source, folder / name)
    if tree.way == "overlays":
        shutil.copytree(kernel.device_tree(OVERLAYS, ""), folder / OVERLAYS)
