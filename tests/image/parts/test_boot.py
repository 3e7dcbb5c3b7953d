"""The boot script and the firmware's configuration, as they are written for this card."""

import dataclasses
import re
import subprocess
from pathlib import Path

import pytest

from board.runtime import boot_counters
from image.description import read
from image.errors import ImageError
from image.parts import boot
from image.parts.kernel import Kernel

PROJECT = Path(__file__).resolve().parents[3]
OWN = read(PROJECT / "image/image.toml")
SCRIPT = boot.script(OWN)


def test_the_script_starts_the_slot_that_it_has_read_of_this_card():
    assert "root=PARTUUID=43505401-0${number} ro rauc.slot=${slot}" in SCRIPT
    assert 'setenv console "console=tty0 console=ttyS1,115200"' in SCRIPT
    assert OWN.kernel.command_line in SCRIPT
    assert not re.search("@[A-Z_]+@", SCRIPT)


def test_the_script_and_the_image_agree_where_the_counters_lie():
    assert f"setenv text_size {boot_counters.SIZE - 1:#x}" in SCRIPT  # without the counter, for U-Boot's own functions
    assert f"setenv blocks {boot_counters.SIZE // 512}" in SCRIPT
    assert f"setenv apart {boot_counters.APART // 512:#x}" in SCRIPT
    assert f"part start ${{devtype}} ${{devnum}} {OWN.disk.partition('state').number} first" in SCRIPT


def test_the_script_keeps_all_words_of_the_counters():
    words = " ".join(boot_counters.WORDS)
    assert [line for line in SCRIPT.splitlines() if "env import" in line and "if env" not in line] == [
        f"  env import -c ${{{copy}_text}} ${{text_size}} {words}" for copy in "ab"
    ]
    assert f"env export -c -s ${{text_size}} ${{work_text}} {words};" in SCRIPT
    assert all(
        f"setenv {word}\n" in SCRIPT and f'test -n "${{{word}}}" || setenv {word} ' in SCRIPT
        for word in boot_counters.WORDS
    )


def test_each_if_and_each_loop_of_the_script_ends():
    words = [word for line in SCRIPT.splitlines() if not line.startswith("#") for word in re.split(r"[\s;]+", line)]
    assert words.count("if") == words.count("then") == words.count("fi")
    assert words.count("for") == words.count("do") == words.count("done")


def test_setexpr_is_always_given_hexadecimal_numbers():
    # It reads 10 as 16: whatever it is given has to be one of its own results, or begin with 0x, or be below 10.
    code = "\n".join(line for line in SCRIPT.splitlines() if not line.startswith("#"))
    for left, right in re.findall(r"setexpr \w+ (\S+) \S+ ([^\s;']+)", code):
        for word in (left, right):
            assert word.startswith(("0x", "${")) or word in "0123456789", word


def test_the_firmware_starts_u_boot_with_the_tree_of_its_board():
    text = boot.config(OWN)
    assert "kernel=u-boot.bin\n" in text
    assert "[pi4]\ndevice_tree=bcm2711-rpi-4-b.dtb\n" in text
    assert "[pi3]\ndevice_tree=bcm2837-rpi-3-b.dtb\n" in text
    assert "dtoverlay" not in text


def test_another_base_has_the_firmware_make_the_tree():
    other = dataclasses.replace(OWN, device_tree=dataclasses.replace(OWN.device_tree, way="overlays"))
    assert "dtoverlay=pps-gpio,gpiopin=18\ndtparam=i2c_arm=on\n" in boot.config(other)
    assert "upstream_kernel=0\n" in boot.config(other)
    assert "upstream_kernel=1\n" in boot.config(OWN)


def test_what_the_firmware_adds_to_a_tree_is_on_the_partition(tmp_path: Path):
    version = "6.12.47+rpt-rpi-v8"
    (tmp_path / "kernel/usr/lib/modules" / version).mkdir(parents=True)
    kernel = Kernel(tmp_path / "kernel")
    for name in ("overlays/pps-gpio.dtbo", "overlays/overlay_map.dtb", "broadcom/bcm2710-rpi-3-b.dtb"):
        path = kernel.device_tree("", name)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(name)
    tree = dataclasses.replace(OWN.device_tree, way="overlays", files=("bcm2710-rpi-3-b.dtb",))
    (tmp_path / "boot").mkdir()
    boot.trees(tree, kernel, tmp_path / "boot")
    found = {path.relative_to(tmp_path / "boot").as_posix() for path in (tmp_path / "boot").rglob("*.dtb*")}
    assert found == {"overlays/pps-gpio.dtbo", "overlays/overlay_map.dtb", "bcm2710-rpi-3-b.dtb"}
    assert "[pi3]\ndevice_tree=bcm2710-rpi-3-b.dtb\n" in boot.config(dataclasses.replace(OWN, device_tree=tree))


@pytest.mark.parametrize(
    ("there", "said"),
    [
        ((), "firmware.files: usr/lib/raspi-firmware/bootcode.bin: is not in raspi-firmware"),
        (OWN.firmware.files, "loader.file: usr/lib/u-boot/rpi_arm64/u-boot.bin: is not in u-boot-rpi"),
    ],
)
def test_a_file_that_its_package_does_not_have_is_told_with_its_key(tmp_path: Path, there: tuple[str, ...], said: str):
    (tmp_path / "usr/lib/modules/6.12").mkdir(parents=True)
    (tmp_path / OWN.firmware.folder).mkdir(parents=True)
    for name in there:
        (tmp_path / OWN.firmware.folder / name).touch()
    board = PROJECT / f"board/boards/{OWN.device_tree.board}.toml"
    with pytest.raises(ImageError, match=rf"^{said}\n  \("):
        boot.make(OWN, Kernel(tmp_path), board, tmp_path / "boot")


def test_a_device_tree_that_the_kernel_does_not_have_is_told_with_its_key(tmp_path: Path):
    (tmp_path / "usr/lib/modules/6.12").mkdir(parents=True)
    for way in ("dtc", "overlays"):
        tree = dataclasses.replace(OWN.device_tree, way=way)
        with pytest.raises(
            ImageError, match=r"^device_tree.files: broadcom/bcm2711-rpi-4-b.dtb: is not in the kernel of 6"
        ):
            boot.trees(tree, Kernel(tmp_path), tmp_path)


@pytest.mark.parametrize(("new", "left"), [("0", "3 3"), ("A", "0 3"), ("B", "3 0")])
def test_a_slot_that_did_not_get_well_has_no_tries_again_where_none_is_left(new: str, left: str):
    # The last lines of the script are a shell's as well.
    last = boot.SCRIPT.read_text().partition('all tries again"\n')[2].partition("run save")[0]
    before = f"setenv() {{ eval $1=$2; }}; BOOT_NEW={new} BOOT_A_LEFT=0 BOOT_B_LEFT=0\n"
    ended = subprocess.run(
        ["sh", "-c", f"{before}{last}\necho $BOOT_A_LEFT $BOOT_B_LEFT"], capture_output=True, text=True, check=True
    )
    assert ended.stdout == f"{left}\n"
