"""Manifest of Raspberry Pi Imager 2, which then offers the card with host name, ssh keys and Wi-Fi.

Source: rpi-imager, doc/schema-notes.md, doc/local_json/README.md and filterOsListWithHWTags() in src/imagewriter.cpp.
"""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from image import checksum

SUFFIX = ".rpi-imager-manifest"
_TAG = "pi4-64bit"
# Imager lists an image only if a device of the same manifest has one of its tags.
_DEVICE = {
    "name": "Raspberry Pi 4",
    "description": "Model B",
    "tags": [_TAG],
    "matching_type": "exclusive",
    "default": True,
}


def text(image: Path, sha256: str, file: Path, version: str, epoch: int) -> str:
    """Return the manifest of a card.

    image    the card.
    sha256   its checksum.
    file     file that Imager reads: the card itself, or the card as .xz. Imager needs its absolute path.
    version  version of the card.
    epoch    date of the build, Unix seconds.
    """
    entry: dict[str, Any] = {
        "name": f"captain {version}",
        "description": "V2X box with a Quad Expander: every radio behind one ZeroMQ endpoint",
        "icon": "",
        "url": file.resolve().as_uri(),
        "extract_size": image.stat().st_size,
        "extract_sha256": sha256,
        "image_download_size": file.stat().st_size,
        "release_date": datetime.fromtimestamp(epoch, UTC).strftime("%Y-%m-%d"),
        "devices": [_TAG],
        # user-data and network-config of cloud-init, which `captain box apply` reads; the card has no cloud-init.
        "init_format": "cloudinit",
        "architecture": "armv8",
    }
    return json.dumps({"imager": {"devices": [_DEVICE]}, "os_list": [entry]}, indent=2) + "\n"


def trouble(path: Path, image: Path) -> str:
    """Return the trouble with a manifest of a card, in words; empty without."""
    try:
        entry = json.loads(path.read_text())["os_list"][0]
        found = (entry["url"], entry["extract_size"], entry["extract_sha256"])
        wanted = (image.resolve().as_uri(), image.stat().st_size, checksum.sha256(image))
    except OSError as error:
        return f"{error.filename}: {error.strerror}"
    except (ValueError, LookupError, TypeError) as error:
        return f"{path}: cannot be read: {error}"
    return "" if found == wanted else f"{path}: names {found}, not {wanted}"
