"""Findings in a boot partition that differs from the description."""

import shutil
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from image.description import read
from image.parts import boot
from image.parts.kernel import Kernel
from image.project import PROJECT
from image.verify.boot import compared
from tests.said import of_key, tells

# Trees that are changed when the card is built are looked at by tests/image/verify/test_tree.py.
SOURCE = read(PROJECT / "image/image.toml")
OWN = replace(SOURCE, device_tree=replace(SOURCE.device_tree, way="overlays"))


@pytest.fixture
def kernel(tmp_path: Path) -> Kernel:
    """Packages with a little of everything that is taken from them."""
    folder = tmp_path / "kernel"
    (folder / "usr/lib/modules/6.12").mkdir(parents=True)
    names = [f"{OWN.firmware.folder}/{name}" for name in OWN.firmware.files]
    for name in [
        *names,
        OWN.loader.file,
        *(f"usr/lib/linux-image-6.12/broadcom/{name}" for name in OWN.device_tree.files),
        "usr/lib/linux-image-6.12/overlays/pps-gpio.dtbo",
    ]:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(name.encode())
    return Kernel(folder)


def script(text: str) -> bytes:
    """As mkimage writes one. Source: U-Boot, include/image.h."""
    body = len(text).to_bytes(4, "big") + bytes(4) + text.encode()
    head = bytearray(64)
    head[:4], head[24:28] = bytes.fromhex("27051956"), zlib.crc32(body).to_bytes(4, "big")
    return bytes(head) + body


@pytest.fixture
def made(tmp_path: Path, kernel: Kernel) -> Path:
    """Its files, as boot.make() leaves them."""
    folder = tmp_path / "boot"
    shutil.copytree(boot.FILES, folder)
    for name in OWN.firmware.files:
        shutil.copy(kernel.folder / OWN.firmware.folder / name, folder)
    boot.trees(OWN.device_tree, kernel, folder)
    shutil.copy(kernel.folder / OWN.loader.file, folder / boot.LOADER)
    (folder / "config.txt").write_text(boot.config(OWN))
    (folder / "boot.scr").write_bytes(script(boot.script(OWN)))
    return folder


def troubles(folder: Path, kernel: Kernel) -> dict[str, str]:
    return {check: trouble for check, trouble in compared(OWN, folder, kernel) if trouble}


def test_a_partition_as_described_has_no_trouble(made: Path, kernel: Kernel):
    assert troubles(made, kernel) == {}


def put(name: str, octets: bytes) -> Callable[[Path], object]:
    def change(folder: Path) -> object:
        (folder / name).parent.mkdir(exist_ok=True)
        return (folder / name).write_bytes(octets)

    return change


def zeros(folder: Path) -> object:
    path = folder / "u-boot.bin"
    return path.write_bytes(path.read_bytes() + bytes(100))


PACKED = "firmware, loader and trees are the packages'"


@pytest.mark.parametrize(
    ("change", "check", "said"),
    [
        (put("authorized_keys", b"ssh-ed25519 AAAA"), "nothing else is on the boot partition", "['authorized_keys'] are"),
        (put("mqtt/box.key", b"x"), "nothing else is on the boot partition", "['mqtt/box.key'] are"),
        (put("start4.elf", b""), PACKED, "['start4.elf'] are others"),
        (zeros, PACKED, "['u-boot.bin'] are others"),
        (put("bcm2711-rpi-4-b.dtb", b""), PACKED, "['bcm2711-rpi-4-b.dtb'] are others"),
        (put("overlays/pps-gpio.dtbo", b""), PACKED, "['overlays/pps-gpio.dtbo'] are others"),
        (put("README.txt", b""), "files for a person", "['README.txt'] are others"),
        (put("config.txt", b""), "config.txt is that of the description", "its text is another"),
        (put("boot.scr", bytes(2000)), "boot.scr is that of the description", "U-Boot would not run it"),
        (put("boot.scr", script("sysboot\n")), "boot.scr is that of the description", "its text is another"),
    ],
)  # fmt: skip
def test_what_was_changed_is_told(made: Path, kernel: Kernel, change: Callable[[Path], object], check: str, said: str):
    change(made)
    assert troubles(made, kernel) == {check: said}


def test_boot_files_that_are_absent_fail_once_and_end_no_other_check(made: Path, kernel: Kernel):
    for name in ("boot.scr", "start4.elf"):
        (made / name).unlink()
    found = troubles(made, kernel)
    assert len(found) == 2
    assert tells(of_key(found, "firmware"), "['boot.scr', 'start4.elf']", "not there")
    assert "U-Boot" in of_key(found, "boot.scr")


def test_config_with_an_open_placeholder_fails_with_its_name(made: Path, kernel: Kernel):
    text = made / "config.txt"
    text.write_text(text.read_text() + "# @LABEL@\n")
    assert "@LABEL@" in of_key(troubles(made, kernel), "open in config.txt")
