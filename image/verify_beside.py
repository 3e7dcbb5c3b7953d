"""What is looked at beside a card: checksums, the list of its packages, their licences."""

import lzma
import tarfile
from collections.abc import Iterator
from pathlib import Path

from image import flash, licences, root
from image.build import Card
from image.errors import ImageError
from image.packages import read_list


def checksums(card: Card) -> Iterator[tuple[str, str]]:
    """Each check with its trouble, which is empty where it is well.

    Whatever was changed since it was built: the other checks look at what they know.
    """
    beside = {"card": card.image, "update": card.bundle, "list of packages": card.packages, "licences": card.licences}
    for what, path in beside.items():
        yield f"the checksum of the {what}", _changed(path, card.checksums)


def agreeing(card: Card, built: Path, there: set[str]) -> Iterator[tuple[str, str]]:
    """Whether list and licences are those of the slot.

    built  folder of the build, whose userland has dpkg's status yet.
    there  paths of the slot, in which a package is known by its licence.
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
    """What only one of them has."""
    more, missing = sorted(said - inside), sorted(inside - said)
    parts = [f"{more} are not in the slot"] if more else []
    return "; ".join([*parts, f"{missing} are missing"] if missing else parts)
