"""Contents of a bundle, as RAUC reads them, before anything is written."""

import configparser
import json
import re
import stat
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from board.runtime.errors import StationError
from board.runtime.tool import environment
from firmware.update.reason import spoken
from firmware.update.verity import Tree

SYSTEM = Path("/etc/rauc/system.conf")
IMAGE = Path("/usr/lib/captain-image")  # folder of the judge; every box has it
SIGNER = IMAGE / "signer"  # written by the build of the image: the signer whose updates it accepts
READ_S = 120.0  # limit for rauc info; it checks a signature in a second
FETCH = "fetch or copy it again; the card was not touched"


class Bundle(NamedTuple):
    """Checked bundle.

    name     name that the user gave.
    size     octets of the file.
    signer   subject of the signer's certificate, RFC 2253.
    written  octets that are written into the slot.
    """

    name: str
    size: int
    version: str
    compatible: str
    build: str
    signer: str
    tree: Tree
    written: int  # octets to be written into the slot


class Box(NamedTuple):
    """Kind of a box. compatible: must equal a bundle's; takes: kind of the image, and accepted signer, in words."""

    compatible: str
    takes: str


def box(system: Path = SYSTEM, signer: Path = SIGNER) -> Box:
    """Return the kind of this box. Raises StationError if the machine is not a box with two slots."""
    found = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        with system.open(encoding="utf-8") as file:
            found.read_file(file)
        compatible = found["system"]["compatible"]
    except (OSError, KeyError, configparser.Error, UnicodeDecodeError) as error:
        raise StationError(
            f"this machine has no update slots: {system} names none",
            "updates work on boxes with the image; elsewhere install the newer program",
        ) from error
    try:
        kind, _, name = signer.read_text(encoding="utf-8").strip().partition(" ")
    except (OSError, UnicodeDecodeError):
        return Box(compatible, "")
    return Box(compatible, f"a {kind} image, which accepts updates signed by {name}")


def demand_box(image: Path = IMAGE) -> None:
    """Check that this machine is a box, even if its slots cannot be read. Raises StationError if it is not."""
    if not image.is_dir():
        box()


def read(path: Path, name: str, program: str = "rauc") -> Bundle:
    """Return a bundle with a valid signature. Raises StationError, with the reason, if it is refused.

    name  name that the user gave, for messages; the path may be that of a download.
    """
    try:
        found = path.stat()
        if not stat.S_ISFIFO(found.st_mode):  # opening a FIFO would wait for a writer
            with path.open("rb"):
                pass
    except OSError as error:
        raise StationError(f"{name}: {error.strerror}", "name a bundle, captain-VERSION-arm64.raucb") from error
    size = found.st_size
    if not stat.S_ISREG(found.st_mode) or size == 0:
        raise StationError(f"{name}: is empty or not a file", FETCH)
    words = [program, "info", "--output-format=json-2", str(path)]
    try:
        ended = subprocess.run(
            words, capture_output=True, text=True, errors="replace", timeout=READ_S, check=False, env=environment()
        )
    except FileNotFoundError as error:
        raise StationError("rauc is not installed: this machine is not a box") from error
    except subprocess.TimeoutExpired as error:
        raise StationError(f"{name}: rauc: timeout after {READ_S:.0f} s", FETCH) from error
    if ended.returncode:
        raise refusal(name, size, ended.stderr)
    try:
        return _bundle(name, size, json.loads(ended.stdout), ended.stderr)
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise StationError(f"{name}: unexpected output of rauc: {ended.stdout[:80]!r}") from error


def fits(bundle: Bundle, own: Box) -> None:
    """Check that a bundle is for this kind of box. Raises StationError if it is for another."""
    if bundle.compatible != own.compatible:
        raise StationError(
            f"{bundle.name}: is for {bundle.compatible!r}; this box is {own.compatible!r}",
            "project, base and device tree must be the same: use the bundle of this box's image",
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


# Patterns of RAUC 1.13's messages, their meaning, and a remedy; without a remedy, RAUC's message is shown.
REASONS = (
    (r"self-signed certificate|unable to get (local )?issuer|unable to verify the first",
     "unknown signer", "use a bundle of this image's signer"),
    (r"certificate (is not yet valid|has expired)", "its signer's certificate was not valid when it signed", ""),
    # Errors of OpenSSL that depend on the damaged place: the signer's name, a number's length, the signature.
    (r"signature verification failed: (?!Verify error)|[Vv]erification failure|digest_verify|no valid CMS",
     "invalid signature: it was changed or damaged", FETCH),
    (r"Invalid bundle|exceeds bundle size|Failed to (seek|read)|not a (RAUC )?bundle|short read",
     "not a bundle, or truncated ({size} octets)", FETCH),
    (r"ormat '?plain'? not allowed|ormat .* not (allowed|supported)",
     "unsupported bundle format", "use a bundle in verity format"),
)  # fmt: skip


def refusal(name: str, size: int, log: str) -> StationError:
    """Return the StationError for a refused bundle of `size` octets, from rauc's error output."""
    lines = spoken(log)
    said = lines[-1] if lines else "rauc gives no reason"
    foreign, *_ = REASONS
    for reason in REASONS:
        pattern, words, hint = reason
        if re.search(pattern, log):
            if reason is foreign and (takes := box_takes()):
                hint = f"this is {takes}; use a bundle of that signer"
            return StationError(f"{name}: {words.format(size=size)}", hint or said)
    return StationError(f"{name}: rejected: {said}", FETCH)


def box_takes() -> str:
    """Return the image's kind and accepted signer in words; empty if unknown."""
    try:
        return box().takes
    except StationError:
        return ""
