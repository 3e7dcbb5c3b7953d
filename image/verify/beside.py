"""Verifies the files beside a card: checksums, manifest, package list, licences."""

import lzma
import tarfile
from collections.abc import Iterator
from pathlib import Path

from image import manifest
from image.card import flash
from image.card.build import CardBuild
from image.errors import ImageError
from image.packages import read_list
from image.parts import root
from image.program import licences


def checksums(card: CardBuild) -> Iterator[tuple[str, str]]:
    """Yield each check with its trouble, which is empty if it passed.

    Checksums show any change since the build; the other checks see only what they test.
    """
    beside = {"card": card.image, "update": card.bundle, "list of packages": card.packages, "licences": card.licences}
    for what, path in beside.items():
        yield f"the checksum of the {what}", _changed(path, card.checksums)
    yield "the manifest of Raspberry Pi Imager", manifest.trouble(card.manifest, card.image)


def agreeing(card: CardBuild, built: Path, there: set[str]) -> Iterator[tuple[str, str]]:
    """Check that list and licences agree with the slot; yield as checksums().

    built  folder of the build, whose userland still has dpkg's status.
    there  paths of the slot; the licence of each package is among them.
    """
    yield "the list of packages", _listed(card.packages, built, there)
    yield "the licences", _licences(card.licences, there)


def _listed(path: Path, built: Path, there: set[str]) -> str:
    try:
        listed = read_list(path)
        inside = {package.name: package.version for package in read_list(built / "packages/unpacked.json")}
        inside |= root.installed(built / "userland/root.tar")
    except ImageError as error:
        return str(error).splitlines()[0]
    except OSError as error:
        return f"{error.filename or path}: {error.strerror}"
    without = sorted(one.name for one in listed if f"usr/share/doc/{one.name}" not in there)
    if without:
        return f"{without} are not in the slot"
    return _otherwise({f"{one.name} {one.version}" for one in listed}, {" ".join(pair) for pair in inside.items()})


def _licences(archive: Path, there: set[str]) -> str:
    try:
        return _otherwise(licences.packed(archive), licences.in_slot(there))
    except OSError as error:
        return f"{archive}: cannot be read: {error.strerror}"
    except (tarfile.TarError, lzma.LZMAError, EOFError) as error:
        return f"{archive}: cannot be read: {error}"


def _changed(path: Path, sums: Path) -> str:
    if not path.exists():
        return f"{path}: is not there"
    try:
        flash.compare(path, sums)
    except ImageError as error:
        return str(error).splitlines()[0]
    return ""


def _otherwise(said: set[str], inside: set[str]) -> str:
    """Return what only one of the sets has, in words."""
    more, missing = sorted(said - inside), sorted(inside - said)
    parts = [f"{more} are not in the slot"] if more else []
    return "; ".join([*parts, f"{missing} are missing"] if missing else parts)
