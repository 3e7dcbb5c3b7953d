"""What is in a bundle, as RAUC reads it: looked at by whoever asks, before anything is asked of the service."""

import configparser
import json
import re
import stat
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from board.errors import StationError
from board.tool import environment
from firmware.box.update_reason import spoken
from firmware.box.update_verity import Tree

SYSTEM = Path("/etc/rauc/system.conf")
IMAGE = Path("/usr/lib/captain-image")  # where its judge is: no box is without
SIGNER = IMAGE / "signer"  # written when the image was built: whose updates it takes
READ_S = 120.0  # a signature is checked in a second
FETCH = "fetch or copy it again; the card was not touched"


class Bundle(NamedTuple):
    """name: as its user calls it. size: octets, of the file. signer: subject of the certificate, RFC 2253."""

    name: str
    size: int
    version: str
    compatible: str
    build: str
    signer: str
    tree: Tree
    written: int  # octets that go into the slot


class Box(NamedTuple):
    """compatible: what a bundle has to be for. takes: kind of the image and signer of its updates, in words."""

    compatible: str
    takes: str


def box(system: Path = SYSTEM, signer: Path = SIGNER) -> Box:
    """Of this machine. Raises StationError: it is no box with two slots."""
    found = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        with system.open(encoding="utf-8") as file:
            found.read_file(file)
        compatible = found["system"]["compatible"]
    except (OSError, KeyError, configparser.Error, UnicodeDecodeError) as error:
        raise StationError(
            f"this machine has no two slots that updates go to: {system} says nothing of them",
            "updates are for boxes that run the image; elsewhere install the newer program",
        ) from error
    try:
        kind, _, name = signer.read_text(encoding="utf-8").strip().partition(" ")
    except (OSError, UnicodeDecodeError):
        return Box(compatible, "")
    return Box(compatible, f"a {kind} image, which takes updates that are signed by {name}")


def demand_box(image: Path = IMAGE) -> None:
    """Raises StationError where this machine is no box. One whose slots cannot be read is one."""
    if not image.is_dir():
        box()


def read(path: Path, name: str, program: str = "rauc") -> Bundle:
    """A bundle whose signature is good. Raises StationError: why it is not taken.

    name  what its user has named: where it was fetched to says nothing to him.
    """
    try:
        found = path.stat()
        if not stat.S_ISFIFO(found.st_mode):  # which would wait for who writes into it
            with path.open("rb"):
                pass
    except OSError as error:
        raise StationError(f"{name}: {error.strerror}", "name a bundle, captain-VERSION-arm64.raucb") from error
    size = found.st_size
    if not stat.S_ISREG(found.st_mode) or size == 0:
        raise StationError(f"{name}: is empty, or no file", FETCH)
    words = [program, "info", "--output-format=json-2", str(path)]
    try:
        ended = subprocess.run(
            words, capture_output=True, text=True, errors="replace", timeout=READ_S, check=False, env=environment()
        )
    except FileNotFoundError as error:
        raise StationError("rauc is not installed: this is no box that can be updated") from error
    except subprocess.TimeoutExpired as error:
        raise StationError(f"{name}: rauc has not read it within {READ_S:.0f} s", FETCH) from error
    if ended.returncode:
        raise refusal(name, size, ended.stderr)
    try:
        return _bundle(name, size, json.loads(ended.stdout), ended.stderr)
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise StationError(f"{name}: rauc says of it what is not understood: {ended.stdout[:80]!r}") from error


def fits(bundle: Bundle, own: Box) -> None:
    """Raises StationError for one of another kind of box."""
    if bundle.compatible != own.compatible:
        raise StationError(
            f"{bundle.name}: is for {bundle.compatible!r}, and this box is {own.compatible!r}",
            "project, base and device tree have to be the same: take the bundle of this box's image",
        )


def _bundle(name: str, size: int, said: Mapping[str, Any], log: str) -> Bundle:
    update, form = said["update"], said["bundle"]
    tree = Tree(int(str(form["verity-size"])), str(form["verity-hash"]), str(form["verity-salt"]))
    signer = re.search(r"Verified \S+ signature by '(.*)'", log)
    written = sum(int(image["size"]) for image in said["images"])
    return Bundle(
        name,
        size,
        str(update["version"]),
        str(update["compatible"]),
        str(update.get("build", "")),
        signer[1] if signer else "",
        tree,
        written,
    )


# What RAUC 1.13 says, in part, and what it means.
_REASONS = (
    (r"self-signed certificate|unable to get (local )?issuer|unable to verify the first", "FOREIGN"),
    (r"certificate (is not yet valid|has expired)", "DATE"),
    # Whatever OpenSSL stumbles on, which depends on what was hit: the signer's name, a number's length, the signature.
    (r"signature verification failed: (?!Verify error)|[Vv]erification failure|digest_verify|no valid CMS", "CHANGED"),
    (r"Invalid bundle|exceeds bundle size|Failed to (seek|read)|not a (RAUC )?bundle|short read", "TRUNCATED"),
    (r"ormat '?plain'? not allowed|ormat .* not (allowed|supported)", "FORM"),
)  # fmt: skip


def refusal(name: str, size: int, log: str) -> StationError:
    """Why a bundle is not taken, of what rauc wrote to its error output."""
    lines = spoken(log)
    said = lines[-1] if lines else "rauc gives no reason"
    kind = next((word for pattern, word in _REASONS if re.search(pattern, log)), "")
    match kind:
        case "FOREIGN":
            takes = box_takes()
            return StationError(
                f"{name}: is signed by somebody whom this box does not know",
                f"this is {takes}; a bundle of that signer is taken"
                if takes
                else "take a bundle of this image's signer",
            )
        case "DATE":
            return StationError(f"{name}: its signer's certificate was not valid when it signed", said)
        case "CHANGED":
            return StationError(f"{name}: its signature does not fit: it was changed or damaged", FETCH)
        case "TRUNCATED":
            what = f"{name}: is no bundle, or not all of one ({size} octets)"
            return StationError(what, FETCH)
        case "FORM":
            return StationError(f"{name}: is of another form than verity, whose contents are not looked at in time")
    return StationError(f"{name}: is not taken: {said}", FETCH)


def box_takes() -> str:
    """Whose updates this image takes; empty where it does not say."""
    try:
        return box().takes
    except StationError:
        return ""
