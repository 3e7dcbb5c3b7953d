"""Files beside a card: package list, licences, changed and missing files."""

import io
import json
import tarfile
from collections.abc import Callable
from pathlib import Path

import pytest

from image import checksum, manifest, packages
from image.card import build
from image.description import read
from image.packages import Package
from image.program import licences
from image.project import PROJECT
from image.verify import beside as verify_beside
from tests.said import of_key, tells

INSTALLED, UNPACKED = Package("a", "1:2", "arm64", "00", "a.deb"), Package("b", "3", "all", "11", "b.deb")
LIST = "the list of packages"  # name of its check
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
    sha256 = checksum.sha256(planned.image)
    planned.manifest.write_text(manifest.text(planned.image, sha256, planned.image, "1.2", 0))
    return planned


def told(card: build.CardBuild) -> dict[str, str]:
    """What is wrong."""
    built = card.slot.parent.parent
    rows = [*verify_beside.checksums(card), *verify_beside.agreeing(card, built, THERE)]
    assert len(rows) == 7
    return {check: trouble for check, trouble in rows if trouble}


def test_what_was_built_has_no_trouble(card: build.CardBuild):
    assert told(card) == {}


@pytest.mark.parametrize(
    ("name", "what"),
    [("image", "card"), ("bundle", "update"), ("packages", "list of packages"), ("licences", "licences")],
)
def test_file_that_was_changed_or_is_gone_fails_its_checksum(card: build.CardBuild, name: str, what: str):
    path: Path = getattr(card, name)
    path.write_bytes(path.read_bytes() + b" ")
    assert tells(of_key(told(card), f"checksum of the {what}"), f"{path}: ", "changed")
    path.unlink()
    assert tells(of_key(told(card), f"checksum of the {what}"), f"{path}: ", "not there")


def test_checksums_that_are_gone_or_lack_a_file_fail_for_each_file(card: build.CardBuild):
    lines = card.checksums.read_text().splitlines()
    card.checksums.write_text("\n".join(lines[:2]))
    found = told(card)
    assert (len(found), len([name for name in found if "checksum" in name])) == (2, 2)
    assert all(of_key(found, what) for what in ("packages", "licences"))
    card.checksums.unlink()
    assert len(told(card)) == 4


@pytest.mark.parametrize(
    ("listed", "said"),
    [
        ([INSTALLED], ["['b 3']", "missing"]),
        ([UNPACKED], ["['a 1:2']", "missing"]),
        ([INSTALLED, UNPACKED._replace(version="4")], ["['b 4']", "not in the slot", "['b 3']", "missing"]),
        ([INSTALLED._replace(version="2"), UNPACKED], ["['a 2']", "not in the slot", "['a 1:2']", "missing"]),
        ([INSTALLED, UNPACKED, REMOVED], ["['apt']", "not in the slot"]),
    ],
)
def test_list_of_other_packages_than_in_the_slot_fails_with_the_difference(
    card: build.CardBuild, listed: list[Package], said: list[str]
):
    packages.write_list(card.packages, listed)
    found = told(card)[LIST]
    assert tells(found, *said)
    assert found.count("[") == len(said) // 2


@pytest.mark.parametrize("text", ["", "{", "7", "[7]", "[[]]", json.dumps([{"name": "a"}]), '{"a": 1}'])
def test_list_of_packages_that_is_malformed_fails_by_its_path(card: build.CardBuild, text: str):
    card.packages.write_text(text)
    assert tells(told(card)[LIST], f"{card.packages}: ", "not a list")


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
