"""image.toml, and what is said of every mistake in it."""

import contextlib
import json
import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as some

from image.description import ON_BOOT, Description, read
from image.errors import ImageError
from image.parts import boot, device_tree
from image.verify import boot as verify_boot

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
        ('suite = "trixie"', "suite = 13", "base.suite: 13 is an integer; give text in quotes"),
        ('suite = "trixie"', "", "base.suite: is missing; give text in quotes"),
        ('suite = "trixie"', 'suit = "trixie"', "base.suit: is not a known key; did you mean suite?"),
        ('suite = "trixie"', 'suite = ""', 'base.suite: "" is an invalid suite; give one as trixie'),
        ('suite = "trixie"', 'suite = "trixie main"', 'base.suite: "trixie main" is an invalid suite'),
        ('suite = "trixie"', 'suite = "../trixie"', 'base.suite: "../trixie" is an invalid suite'),
        (
            '"-security", ',
            '"security", ',
            'base.mends[0]: "security" is an invalid end of a suite\'s name; give one as -security',
        ),
        ('"-security", ', '"-updates", ', 'base.mends: "-updates" is there twice; name it once'),
        ('architecture = "arm64"', 'architecture = "amd64"', 'base.architecture: "amd64" is not a choice'),
        ('suite = "bookworm"', 'suite = "../12"', 'release.suite: "../12" is an invalid suite; give one as trixie'),
        ('suite = "bookworm"', 'suit = "bookworm"', "release.suit: is not a known key; did you mean suite?"),
        ('"python3.11" = "the interpreter"', '"python3.11" = ""', 'release.packages."python3.11": has no reason'),
        ("[release.packages]", "[release.package]", "release.packages: is missing; give a table"),
        ('components = ["main", "non-free-firmware"]', 'components = "main"', 'base.components: "main" is text'),
        ('["main", "non-free-firmware"]', "[]", "base.components: is empty; name one at least"),
        ('["main", "non-free-firmware"]', '["main", "main"]', 'base.components: "main" is there twice; name it once'),
        ('["main", "non-free-firmware"]', '["main\\n"]', r'base.components[0]: "main\n" is an invalid component'),
        ('keyring = "/usr', 'keyring = "usr', 'base.keyring: "usr/share'),
        ('archive-keyring.gpg"', 'archive keyring.gpg"', "is an invalid path of a file; give all of it"),
        (
            'name = "captain"',
            'name = ""',
            'name: "" is an invalid host name; give lower-case letters, digits and -, as captain',
        ),
        ('name = "captain"', 'name = "../captain"', 'name: "../captain" is an invalid host name'),
        ('name = "captain"', 'name = "a\\u0000b"', r'name: "a\x00b" is an invalid host name'),
        ('name = "captain"', f'name = "{"a" * 64}"', "is an invalid host name"),
        ('package = "linux-image-arm64"', "package = 1", "kernel.package: 1 is an integer; give text in quotes"),
        ('package = "linux-image-arm64"', 'package = "a=1"', 'kernel.package: "a=1" is an invalid package\'s name'),
        (
            'package = "u-boot-rpi"',
            'package = "u-boot-rpi-"',
            'loader.package: "u-boot-rpi-" is an invalid package\'s name',
        ),
        ('"ext4", "overlay"', '"ext4", "ext4"', 'kernel.modules: "ext4" is there twice'),
        ('"ext4", "overlay"', '"ext4", "--all"', '"--all" is an invalid module\'s name'),
        ('"ext4", "overlay"', '"ext4", "a b"', '"a b" is an invalid module\'s name'),
        (
            'folder = "usr/lib/raspi-firmware"',
            'folder = "/usr/lib"',
            'firmware.folder: "/usr/lib" is an invalid path in a pack',
        ),
        (
            'folder = "broadcom"',
            'folder = "../broadcom"',
            'device_tree.folder: "../broadcom" is an invalid path in a package',
        ),
        ('file = "usr/lib/u-boot', 'file = "usr/lib/../u-boot', "loader.file: "),
        (
            '"start.elf"',
            '"../start.elf"',
            'firmware.files[1]: "../start.elf" is an invalid file\'s name; give it without a folder',
        ),
        ('"start.elf"', '"/start.elf"', 'firmware.files[1]: "/start.elf" is an invalid file\'s name'),
        ('"start.elf"', '""', 'firmware.files[1]: "" is an invalid file\'s name'),
        ('"start.elf"', '"bootcode.bin"', 'firmware.files: "bootcode.bin" is there twice; name it once'),
        ('"start.elf"', '"BOOTCODE.bin"', "there is another BOOTCODE.bin on the boot partition; leave it out"),
        ('"start.elf"', '"config.txt"', "there is another config.txt on the boot partition; leave it out"),
        ('"bcm2837-rpi-3-b.dtb"', '"bcm2837-rpi-3-b"', "device_tree.files[1]: "),
        ('board = "quad"', 'board = "../quad"', 'device_tree.board: "../quad" is an invalid board\'s name'),
        ('way = "dtc"', 'way = "dtb"', 'device_tree.way: "dtb" is not a choice; did you mean "dtc"?'),
        ("i2c = [1]", "i2c = [7]", "device_tree.i2c[0]: 7 is not a choice; known: 1, 3, 4, 5, 6"),
        ("i2c = [1]", "i2c = [2]", "device_tree.i2c[0]: 2 is not a choice; known: 1, 3, 4, 5, 6"),
        ("i2c = [1]", 'i2c = ["1"]', 'device_tree.i2c[0]: "1" is not a choice'),
        ("i2c = [1]", "i2c = [1, 1]", "device_tree.i2c: 1 is there twice"),
        ("uarts = []", "uarts = [1]", "device_tree.uarts[0]: 1 is not a choice; known: 2, 3, 4, 5"),
        (
            "pulse_gpio = 18",
            "pulse_gpio = 28",
            "device_tree.pulse_gpio: 28 is out of range; give at least 0 and at most 27",
        ),
        ("baud = 115200", "baud = true", "console.baud: true is not a choice"),
        ("baud = 115200", "baud = -5", "console.baud: -5 is not a choice; known: 1200, 2400,"),
        ("baud = 115200", "baud = 0", "console.baud: 0 is not a choice"),
        ("baud = 115200", "baud = 115201", "console.baud: 115201 is not a choice; did you mean 115200?"),
        ('device = "ttyS1"', 'device = "/dev/ttyS1"', 'console.device: "/dev/ttyS1" is an invalid serial port\'s name'),
        (
            'device = "ttyS1"',
            'device = "ttyS1,9600 init=/bin/sh"',
            "is an invalid serial port's name; give one as ttyS1",
        ),
        ("label_id = 0x43505401", "label_id = 0", "disk.label_id: 0 is out of range"),
        ("label_id = 0x43505401", "label_id = 0x1_0000_0000", "disk.label_id: 4294967296 is out of range"),
        ("size_mib = 2048", "size_mib = 2000", "disk.size_mib: 2000 is not a power of two"),
        (
            "size_mib = 2048",
            "size_mib = -2048",
            "disk.size_mib: -2048 is out of range; give at least 1 and at most 32768",
        ),
        ("size_mib = 2048", "size_mib = 1048576", "disk.size_mib: 1048576 is out of range"),
        ("size_mib = 304", "size_mib = 400", "disk.size_mib: 2048: the partitions take 2136 of 2040 MiB"),
        ("size_mib = 304", "size_mib = 0", "disk.partitions[4].size_mib: 0 is out of range"),
        ("size_mib = 304", "size_mib = 1", "data: size_mib 1 is less than 256 MiB; its journal has 16 MiB, the log 48"),
        ("size_mib = 128", "size_mib = 32", "boot: size_mib 32 is less than 33 MiB; a FAT32 has 65525 clusters"),
        ("size_mib = 800", "size_mib = 100", "root-a: size_mib 100 is less than 512 MiB"),
        ("size_mib = 8\n", "size_mib = 4\n", "state: size_mib 4 is less than 8 MiB; its second copy begins at 4 MiB"),
        ('name = "state"', 'name = "status"', "are not the five partitions that the boot script knows"),
        ("number = 5", "number = 4", "[1, 2, 3, 4, 6] are not [1, 2, 3, 5, 6]"),
        ('id = "b0070001"', 'id = "B0070001"', 'boot: id "B0070001" has not the form xxxxxxxx'),
        ("0a01", "0a02", "root-a and root-b have different ids"),
        ("2d0d06", "2d0a01", "data and a root partition have the same id"),
        ('kmod = "modules"', 'kmod = " "', "packages.install.kmod: has no reason; say what it is for, or leave it out"),
        ('kmod = "modules"', r'kmod = "a\u0007"', r'packages.install.kmod: "a\x07" has control characters'),
        ('kmod = "modules"', 'busybox-static = "twice"', "packages: busybox-static is in install and in unpack"),
        ('kmod = "modules"', 'kmod = ["modules"]', "packages.install.kmod: "),
        (
            'kmod = "modules"',
            '"" = "modules"',
            'packages.install: "" is an invalid package\'s name; give one as apt has it',
        ),
        ('kmod = "modules"', r'"a\nb" = "modules"', r'packages.install: "a\nb" is an invalid package'),
        ("[base]", "[base", "line 4, column 6: "),
    ],
)
def test_a_mistake_is_told_with_its_place_and_its_value(tmp_path: Path, old: str, new: str, said: str):
    path = changed(tmp_path, old, new)
    with pytest.raises(ImageError) as told:
        read(path)
    assert said in str(told.value)
    assert str(told.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    "sign", ['\\"', "'", "$", ";", "\\\\", "&", "|", "`", "#", r"\n", r"\u0000", r"\u007f", "ä", "@LABEL@"]
)
def test_a_command_line_has_nothing_that_the_boot_script_would_read(tmp_path: Path, sign: str):
    with pytest.raises(
        ImageError, match=r"kernel\.command_line: .* is an invalid command line; give at most 1024 letters"
    ):
        read(changed(tmp_path, "quiet loglevel=4", f"quiet {sign} loglevel=4"))
    read(changed(tmp_path, "quiet loglevel=4", "quiet memmap=64K@0x18000 a.b-c_d=e:f,g/h+50%~* loglevel=4"))


def test_a_command_line_is_no_longer_than_a_kernel_takes(tmp_path: Path):
    with pytest.raises(ImageError, match=r"kernel\.command_line: .* is an invalid command line"):
        read(changed(tmp_path, "quiet", "q" * 1024))


def test_all_mistakes_are_told_in_one_round(tmp_path: Path):
    path = changed(tmp_path, "baud = 115200", "baud = 1")
    path.write_text(path.read_text().replace("pulse_gpio = 18", "pulse_gpio = -1"))
    with pytest.raises(ImageError, match=r"(?s)device_tree\.pulse_gpio.*\n.*console\.baud"):
        read(path)


LINES = [at for at, line in enumerate(OWN.read_text().splitlines()) if re.match(r'[\w"+.-]+ *=', line)]
WORDS = some.text(some.characters(exclude_categories=["Cs"])).map(json.dumps)
RUBBISH = (
    WORDS | some.integers().map(str) | some.sampled_from(["true", "nan", "1979-05-27", "{}", "[[]]", "[{a = 1}]", ""])
)


@given(at=some.sampled_from(LINES), rubbish=RUBBISH)
def test_rubbish_in_a_line_is_read_or_told_in_words(tmp_path_factory: pytest.TempPathFactory, at: int, rubbish: str):
    lines = OWN.read_text().splitlines()
    lines[at] = f"{lines[at].partition('=')[0]}= {rubbish}"
    path = tmp_path_factory.getbasetemp() / "rubbish.toml"
    path.write_text("\n".join(lines))
    with contextlib.suppress(ImageError):
        read(path)


@given(octets=some.binary())
def test_random_octets_are_told_in_words(tmp_path_factory: pytest.TempPathFactory, octets: bytes):
    path = tmp_path_factory.getbasetemp() / "random.toml"
    path.write_bytes(octets)
    with pytest.raises(ImageError, match=r"random\.toml: "):
        read(path)


def test_a_file_that_is_nested_too_deep_is_told_without_a_traceback(tmp_path: Path):
    (tmp_path / "deep.toml").write_text(f"a = {'[' * 10_000}{']' * 10_000}\n")
    with pytest.raises(ImageError, match=r"deep\.toml: arrays or tables are nested too deep"):
        read(tmp_path / "deep.toml")


def test_names_that_no_other_file_of_the_boot_partition_may_have_are_those_that_lie_there():
    ours = {path.name for path in boot.FILES.iterdir()}
    assert {*ours, boot.LOADER, boot.OVERLAYS, verify_boot.SCRIPT, verify_boot.CONFIG} == set(ON_BOOT)


def test_slots_of_two_sizes_are_refused_as_no_update_would_fit_both(tmp_path: Path):
    with pytest.raises(ImageError, match="root-a and root-b have 700 and 800 MiB; make them equal"):
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
