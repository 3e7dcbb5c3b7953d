"""Files beside a card: package list, licences, changed and missing files."""

import io
import json
import tarfile
from collections.abc import Callable
from pathlib import Path

import pytest

from image import checksum, packages
from image.card import build
from image.description import read
from image.packages import Package
from image.program import licences
from image.project import PROJECT
from image.verify import beside as verify_beside

INSTALLED, UNPACKED = Package("a", "1:2", "arm64", "00", "a.deb"), Package("b", "3", "all", "11", "b.deb")
REMOVED = Package("apt", "4", "arm64", "22", "apt.deb")  # which apt takes for essential, and is not in the card
THERE = {"etc", "usr/share/doc/a", "usr/share/doc/a/copyright", "usr/share/doc/b", "usr/share/doc/b/copyright"}
STATUS = """Package: a
Status: install ok installed
Version: 1:2
Description: of it
 Version: 9

Package: c
Status: deinstall ok config-files
Version: 1
"""


def tar(path: Path, files: dict[str, bytes]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with tarfile.open(path, "w") as archive:
        for name, octets in files.items():
            head = tarfile.TarInfo(name)
            head.size = len(octets)
            archive.addfile(head, io.BytesIO(octets))


@pytest.fixture
def card(tmp_path: Path) -> build.CardBuild:
    """As a build leaves it, beside its folder."""
    folder = tmp_path / "image"
    tar(folder / "userland/root.tar", {"./var/lib/dpkg/status": STATUS.encode()})
    tar(folder / "parts/root.tar", {path: b"text" for path in THERE if path.endswith("copyright")})
    (folder / "packages").mkdir()
    packages.write_list(folder / "packages/userland.json", [INSTALLED, REMOVED])
    packages.write_list(folder / "packages/unpacked.json", [UNPACKED])
    planned = build.planned(read(PROJECT / "image/image.toml"), folder)
    planned.image.write_bytes(b"card")
    planned.bundle.write_bytes(b"update")
    packages.write_list(planned.packages, [INSTALLED, UNPACKED])
    licences.pack(folder / "parts/root.tar", planned.licences)
    beside = (planned.image, planned.bundle, planned.packages, planned.licences)
    planned.checksums.write_text(checksum.sums(beside))
    return planned


def told(card: build.CardBuild) -> dict[str, str]:
    """What is wrong."""
    built = card.slot.parent.parent
    rows = [*verify_beside.checksums(card), *verify_beside.agreeing(card, built, THERE)]
    assert len(rows) == 6
    return {check: trouble for check, trouble in rows if trouble}


def test_what_was_built_has_no_trouble(card: build.CardBuild):
    assert told(card) == {}


@pytest.mark.parametrize(
    ("name", "what"),
    [("image", "card"), ("bundle", "update"), ("packages", "list of packages"), ("licences", "licences")],
)
def test_each_file_that_was_changed_or_is_gone_is_told(card: build.CardBuild, name: str, what: str):
    path: Path = getattr(card, name)
    path.write_bytes(path.read_bytes() + b" ")
    assert told(card)[f"the checksum of the {what}"] == f"{path}: has changed since it was built"
    path.unlink()
    assert told(card)[f"the checksum of the {what}"] == f"{path}: is not there"


def test_checksums_that_are_gone_or_lack_a_file_are_told(card: build.CardBuild):
    lines = card.checksums.read_text().splitlines()
    card.checksums.write_text("\n".join(lines[:2]))
    assert told(card).keys() == {"the checksum of the list of packages", "the checksum of the licences"}
    card.checksums.unlink()
    assert len(told(card)) == 4


@pytest.mark.parametrize(
    ("listed", "said"),
    [
        ([INSTALLED], "['b 3'] are missing"),
        ([UNPACKED], "['a 1:2'] are missing"),
        ([INSTALLED, UNPACKED._replace(version="4")], "['b 4'] are not in the slot; ['b 3'] are missing"),
        ([INSTALLED._replace(version="2"), UNPACKED], "['a 2'] are not in the slot; ['a 1:2'] are missing"),
        ([INSTALLED, UNPACKED, REMOVED], "['apt'] are not in the slot"),
    ],
)
def test_a_list_of_others_than_are_in_the_slot_is_told(card: build.CardBuild, listed: list[Package], said: str):
    packages.write_list(card.packages, listed)
    assert told(card)["the list of packages"] == said


@pytest.mark.parametrize("text", ["", "{", "7", "[7]", "[[]]", json.dumps([{"name": "a"}]), '{"a": 1}'])
def test_a_list_that_is_none_is_told(card: build.CardBuild, text: str):
    card.packages.write_text(text)
    assert told(card)["the list of packages"].startswith(f"{card.packages}: not a list of packages: ")


def cut(path: Path) -> None:
    octets = path.read_bytes()
    path.write_bytes(octets[: len(octets) // 2])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


@pytest.mark.parametrize("change", [cut, emptied, Path.unlink])
def test_licences_that_cannot_be_read_are_told(card: build.CardBuild, change: Callable[[Path], None]):
    change(card.licences)
    assert told(card)["the licences"].startswith(f"{card.licences}: cannot be read: ")


def test_licences_of_others_than_are_in_the_slot_are_told(card: build.CardBuild):
    other = card.slot.parent / "root.tar"
    tar(other, {"usr/share/doc/a/copyright": b"text", "usr/share/doc/z/copyright": b"text"})
    licences.pack(other, card.licences)
    said = "['usr/share/doc/z/copyright'] are not in the slot; ['usr/share/doc/b/copyright'] are missing"
    assert told(card)["the licences"] == said
