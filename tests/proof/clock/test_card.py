"""Input at a card's boot loader, and the station's configuration."""

import base64
import tomllib
from pathlib import Path

from board.description import Hardware
from board.runtime.describe import read
from firmware.config import captain_toml
from image.description import read as read_image
from image.parts import boot
from tests.proof.clock.card import LINE, RECEIVER_PLACE, WORDS, typed
from tests.proof.clock.files import BOARD, captain

U_BOOT_LINE = 511  # it beeps for what is beyond: CONFIG_SYS_CBSIZE of Debian's qemu_arm64
COMMAND_LINE = 2048  # COMMAND_LINE_SIZE of the kernel for arm64
IMAGE = Path(__file__).resolve().parents[3] / "image/image.toml"


def test_each_line_is_short_enough_for_the_boot_loader_and_together_they_are_all_words():
    lines = typed(WORDS)
    assert all(len(line) <= U_BOOT_LINE for line in lines)
    assert "".join(line.partition("${extra_args}")[2].rstrip('"\n') for line in lines) == WORDS
    assert len(lines[0]) > LINE


def test_the_kernel_takes_them_beside_what_the_boot_script_says():
    (said,) = (line for line in boot.script(read_image(IMAGE)).splitlines() if "setenv bootargs" in line)
    assert len(said) + 64 + len(WORDS) < COMMAND_LINE  # what stands for words of the script is longer than its name


def test_the_unit_is_one_that_process_1_can_read():
    credential, *_ = WORDS.split(" ")
    text = base64.b64decode(credential.rpartition(":")[2]).decode()
    assert text.startswith("[Unit]\n")
    assert "\nExecStart=/bin/sh " in text


def test_the_station_takes_its_files(tmp_path: Path):
    for name, text in (("captain.toml", captain("one", f'usb = "{RECEIVER_PLACE}"')), ("board.toml", BOARD)):
        (tmp_path / name).write_text(text)
    loaded = captain_toml.load(str(tmp_path / "captain.toml"), [], str(tmp_path / "board.toml"))
    assert [one.name for one in loaded.interfaces] == ["gnss"]
    assert read(Hardware, tomllib.loads(BOARD), "board.toml").pulse is not None
