"""The box's side of the owner's files, as shell scripts on files of a test: when they are looked at, what is laid over."""

import os
import re
import subprocess
from pathlib import Path

import pytest

from image.own_files import OVERLAY
from tests.firmware.card.conftest import KEY, write
from tests.said import tells

BLINK = OVERLAY / "usr/lib/captain-image/blink"
OWNER = (OVERLAY / "usr/lib/captain-image/owner").read_text()
PROJECT = Path(__file__).resolve().parents[2]
PLACES = (
    "/boot/firmware",
    "/data",
    "/run",
    "/usr/lib/clock-epoch",
    "/usr/lib/captain-image",
    "/etc/captain",
    "/proc/sys",
)


class Box:
    """A box as folders, whose root is a folder; the programs are the real ones."""

    def __init__(self, folder: Path) -> None:
        self.root = folder
        for name in ("boot/firmware", "data", "run/captain-image", "usr/lib/captain-image", "proc/sys/kernel", "bin"):
            (folder / name).mkdir(parents=True)
        write(folder, {"usr/lib/clock-epoch": "", "etc/captain/captain.toml": '[endpoint]\naddress = "0.0.0.0"\n'})
        self._program("captain", f'echo looked >>{folder}/looks\nexec {PROJECT}/.venv/bin/captain "$@"\n')
        self._program("timeout", 'case "$*" in *"${SLOW:-nothing is}"*) exit 124 ;; esac\nexec /usr/bin/timeout "$@"\n')
        self._program("mountpoint", f"[ ! -e {folder}/no-card ]\n")
        self._program("stat", '[ "$1" = -f ] && echo "${DATA:-ext2/ext3}" && exit\nexec /usr/bin/stat "$@"\n')
        self._program("blink", f'echo "$1" >{folder}/blinked\n')

    def _program(self, name: str, text: str) -> None:
        path = self.root / "bin" / name
        path.write_text(f"#!/bin/sh\n{text}")
        path.chmod(0o755)

    def start(self, **environment: str) -> list[str]:
        """What it says to the serial console."""
        text = OWNER.replace("/usr/lib/captain/captain", f"{self.root}/bin/captain").replace("@BOARD@", "none")
        text = text.replace("/usr/lib/captain-image/blink", f"{self.root}/bin/blink")
        for place in PLACES:
            text = text.replace(place, f"{self.root}{place}")
        text = text.replace('"/$', f'"{self.root}/$')
        for name in ("run/early", "blinked"):
            (self.root / name).unlink(missing_ok=True)
        path = f"{self.root}/bin:{os.environ['PATH']}"
        words = {**os.environ, "PATH": path, "PYTHONPATH": str(PROJECT), **environment}
        ended = subprocess.run(["sh", "-c", text], capture_output=True, text=True, env=words, check=False)
        assert (ended.returncode, ended.stderr) == (0, "")
        return (self.root / "run/early").read_text().splitlines()

    def has(self, name: str) -> str:
        path = self.root / name
        return path.read_text() if path.exists() else ""

    @property
    def looks(self) -> int:
        return self.has("looks").count("looked")


@pytest.fixture
def box(tmp_path: Path) -> Box:
    return Box(tmp_path)


@pytest.mark.parametrize("slow", ["box apply", "sha256sum"])
def test_set_whose_check_takes_too_long_leaves_the_last_accepted_one_in_force(box: Box, slow: str):
    card = box.root / "boot/firmware"
    write(card, {"box.toml": 'host_name = "rsu-7"\n', "authorized_keys": KEY})
    box.start()
    (box.root / "etc/hostname").unlink()
    write(card, {"box.toml": 'host_name = "rsu-8"\n'})
    said = box.start(SLOW=slow)
    (told,) = said
    assert tells(told, "owner's files", "not checked: ", "too long; ", "last accepted set")
    assert box.has("blinked") == "2\n"
    assert box.has("etc/hostname") == "rsu-7\n"


def test_what_is_looked_at_ends_before_its_unit_is_ended():
    unit = (OVERLAY / "usr/lib/systemd/system/captain-owner.service").read_text()
    limit_s = int(unit.partition("TimeoutStartSec=")[2].split()[0])
    taken_s = sum(int(killed) + int(ended) for killed, ended in re.findall(r"timeout -k (\d+) (\d+) ", OWNER))
    assert 0 < taken_s <= limit_s - 30


def test_a_set_is_laid_over_the_box_and_looked_at_once(box: Box):
    card = box.root / "boot/firmware"
    write(card, {"box.toml": 'host_name = "rsu-7"\n[console]\nshell = false\n', "authorized_keys": KEY})
    said = "the owner's files are in force: authorized_keys, box.toml; 1 ssh key"
    for _ in range(2):
        assert box.start() == [said]
        assert box.has("etc/hostname") == box.has("proc/sys/kernel/hostname") == "rsu-7\n"
        assert box.has("run/captain-image/environment") == "CAPTAIN_SHELL=\n"
        assert box.has("blinked") == ""
        (box.root / "etc/hostname").unlink()
    assert box.looks == 1


def test_set_with_a_mistake_is_reported_at_each_start_and_leaves_the_last_accepted_one_in_force(box: Box):
    card = box.root / "boot/firmware"
    write(card, {"box.toml": 'host_name = "rsu-7"\n', "authorized_keys": KEY})
    box.start()
    write(card, {"box.toml": 'host_name = "rsu_8"\n'})
    for _ in range(2):
        said = box.start()
        assert tells(said[0], "owner's files", "REJECTED", "1 mistake; ", "last accepted set")
        assert said[1].startswith('box.toml:1: host_name: invalid host name: "rsu_8"')
        assert box.has("blinked") == "2\n"
        assert box.has("etc/hostname") == "rsu-7\n"
    assert box.looks == 2


def test_other_software_looks_at_the_same_files_again(box: Box):
    box.start()
    os.utime(box.root / "usr/lib/clock-epoch", (1, 1))
    box.start()
    assert box.looks == 2


def test_card_that_cannot_be_read_leaves_the_last_accepted_set_in_force(box: Box):
    write(box.root / "boot/firmware", {"box.toml": 'host_name = "rsu-7"\n', "authorized_keys": KEY})
    box.start()
    (box.root / "no-card").touch()
    (told,) = box.start()
    assert tells(told, "boot partition", "cannot be read: ", "last accepted set")
    assert box.has("blinked") == "3\n"
    assert box.has("etc/hostname") == "rsu-7\n"


def test_data_in_memory_is_blinked_above_all(box: Box):
    (box.root / "no-card").touch()
    box.start(DATA="tmpfs")
    assert box.has("blinked") == "4\n"


def test_data_partition_that_takes_nothing_is_reported_and_the_box_goes_on(box: Box):
    (box.root / "data/owner").touch()
    box.root.joinpath("bin/mkdir").write_text('#!/bin/sh\nexec /bin/mkdir "$@" 2>/dev/null\n')
    box.root.joinpath("bin/mkdir").chmod(0o755)
    said = box.start()
    assert tells(said[0], "owner's files", "not checked: captain: ")
    assert box.has("blinked") == "2\n"


def test_the_led_blinks_the_number_by_the_kernels_own_trigger(tmp_path: Path):
    write(tmp_path, {"ACT/trigger": "none", "ACT/max_brightness": "1\n", "ACT/pattern": ""})
    subprocess.run(["sh", BLINK, "2"], env={**os.environ, "LEDS": str(tmp_path)}, check=True)
    assert (tmp_path / "ACT/trigger").read_text() == "pattern\n"
    # On for 200 ms, off for 300, twice; a pause. Each step with a length of zero behind it, or the LED would fade.
    assert (tmp_path / "ACT/pattern").read_text() == "1 200 1 0 0 300 0 0 1 200 1 0 0 300 0 0 0 1500 0 0\n"


def test_a_machine_without_such_an_led_goes_on(tmp_path: Path):
    ended = subprocess.run(
        ["sh", BLINK, "3"], env={**os.environ, "LEDS": str(tmp_path)}, capture_output=True, check=False
    )
    assert (ended.returncode, ended.stderr) == (0, b"no ACT LED: code 3 is not shown\n")
