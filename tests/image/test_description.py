"""image.toml, and what is said of every mistake in it."""

import re
import tomllib
from pathlib import Path

import pytest

from image import device_tree
from image.description import Description, read
from image.errors import ImageError

PROJECT = Path(__file__).resolve().parents[2]
OWN = PROJECT / "image/image.toml"


def changed(tmp_path: Path, old: str, new: str) -> Path:
    text = OWN.read_text()
    assert old in text
    path = tmp_path / "image.toml"
    path.write_text(text.replace(old, new, 1))
    return path


def test_the_own_description_is_read_with_every_key():
    found = read(OWN)
    assert found.base.suite == "trixie"
    assert found.disk.partuuid("root-b") == "43505401-03"
    assert found.packages.install.keys() == tomllib.loads(OWN.read_text())["packages"]["install"].keys()


def test_the_own_description_gives_the_own_board_what_it_asks_for():
    tree = read(OWN).device_tree
    device_tree.wanted_by(device_tree.read_board(PROJECT / f"board/boards/{tree.board}.toml"), tree)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('suite = "trixie"', "suite = 13", "base.suite: 13 is not text in quotes"),
        ('suite = "trixie"', "", "base.suite: is missing"),
        ('suite = "trixie"', 'suit = "trixie"', "base.suit: there is no such key\n  (did you mean suite?)"),
        ('architecture = "arm64"', 'architecture = "amd64"', "base.architecture: 'amd64' is none of arm64"),
        (
            'components = ["main", "non-free-firmware"]',
            'components = "main"',
            "base.components: 'main' is not an array",
        ),
        ('way = "dtc"', 'way = "dtb"', "device_tree.way: 'dtb' is none of dtc, overlays"),
        ("i2c = [1]", "i2c = [7]", "device_tree.i2c[0]: 7 is not 0 to 6"),
        ("i2c = [1]", 'i2c = ["1"]', "device_tree.i2c[0]: '1' is not an integer"),
        ("uarts = []", "uarts = [1]", "device_tree.uarts[0]: 1 is not 2 to 5"),
        ("pulse_gpio = 18", "pulse_gpio = 28", "device_tree.pulse_gpio: 28 is not 0 to 27"),
        ("baud = 115200", "baud = true", "console.baud: True is not an integer"),
        ("label_id = 0x43505401", "label_id = 0", "disk.label_id: 0x0 has more than 32 bits, or none"),
        (
            "label_id = 0x43505401",
            "label_id = 0x1_0000_0000",
            "disk.label_id: 0x100000000 has more than 32 bits, or none",
        ),
        ("size_mib = 2048", "size_mib = 2000", "disk.size_mib: 2048"),
        ("size_mib = 304", "size_mib = 400", "disk.size_mib: 2048: the partitions take 2136 of 2040 MiB"),
        ('name = "state"', 'name = "status"', "are not the five that the boot script knows"),
        ("number = 5", "number = 4", "are not 1, 2, 3, 5, 6"),
        ("size_mib = 8\n", "size_mib = 4\n", "state has less than 8 MiB"),
        ('id = "b0070001"', 'id = "B0070001"', "boot: id 'B0070001' has not the form xxxxxxxx"),
        ('kmod = "modules"', 'kmod = " "', "packages.install.kmod: has no reason"),
        ('kmod = "modules"', 'busybox-static = "twice"', "packages: busybox-static is in install and in unpack"),
        ('kmod = "modules"', 'kmod = ["modules"]', "packages.install.kmod: ['modules'] is not text in quotes"),
        ("[base]", "[base", "is not TOML"),
    ],
)
def test_a_mistake_is_told_with_its_place_and_its_value(tmp_path: Path, old: str, new: str, said: str):
    with pytest.raises(ImageError) as told:
        read(changed(tmp_path, old, new))
    # The message for sizes names the number that was found.
    assert (said if new != "size_mib = 2000" else "disk.size_mib: 2000") in str(told.value)


def test_slots_of_two_sizes_are_refused_as_no_update_would_fit_both(tmp_path: Path):
    with pytest.raises(ImageError, match="root-a and root-b have not the same size"):
        read(changed(tmp_path, "size_mib = 800", "size_mib = 700"))


def test_a_file_that_is_not_there_is_told_without_a_traceback(tmp_path: Path):
    with pytest.raises(ImageError, match="cannot be read: No such file"):
        read(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("board", "said"),
    [
        ({"pulse": {"device": "/dev/pps0"}}, "device_tree.pulse_gpio: is missing"),
        (
            {"buses": {"main": {"path": "/dev/i2c-3"}}},
            "device_tree.i2c: [1] lacks 3, which is buses.main of board quad",
        ),
    ],
)
def test_a_board_that_asks_for_what_the_tree_will_not_have_is_told(tmp_path: Path, board: dict[str, object], said: str):
    found: Description = read(changed(tmp_path, "pulse_gpio = 18", ""))
    with pytest.raises(ImageError, match=re.escape(said)):
        device_tree.wanted_by(board, found.device_tree)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('package = "linux-image-arm64"', 'package = "linux-image-rpi-v8"'),
        ('way = "dtc"', 'way = "overlays"'),
        ('"bcm2837-rpi-3-b.dtb"', '"bcm2710-rpi-3-b.dtb"'),
        ("pulse_gpio = 18", "pulse_gpio = 4"),
        ("i2c = [1]", "i2c = [1, 3]"),
        ("uarts = []", "uarts = [3]"),
        ('board = "quad"', 'board = "pi"'),
        ('suite = "trixie"', 'suite = "forky"'),
        ("label_id = 0x43505401", "label_id = 0x43505402"),
    ],
)
def test_an_update_that_needs_what_this_card_has_not_is_for_another_kind_of_box(tmp_path: Path, old: str, new: str):
    assert read(changed(tmp_path, old, new)).compatible != read(OWN).compatible


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("baud = 115200", "baud = 9600"),
        ("quiet loglevel=4", "loglevel=7"),
        ('kmod = "modules"', 'kmod = "all modules"'),
    ],
)
def test_what_no_slot_needs_of_the_card_lets_an_update_in(tmp_path: Path, old: str, new: str):
    assert read(changed(tmp_path, old, new)).compatible == read(OWN).compatible
