"""Manifest for Raspberry Pi Imager: what it says of a card, and which trouble is found."""

import json
from pathlib import Path
from typing import Any

import pytest

from image import checksum, manifest

# Source: rpi-imager, doc/schema-notes.md: keys of each entry.
REQUIRED = (
    "name", "description", "icon", "url", "extract_size", "extract_sha256", "image_download_size", "release_date",
    "devices",
)  # fmt: skip


@pytest.fixture
def card(tmp_path: Path) -> Path:
    path = tmp_path / "a card.img"
    path.write_bytes(b"card")
    return path


def made(card: Path, file: Path) -> dict[str, Any]:
    text = manifest.text(card, checksum.sha256(card), file, "1.2.3", 1_750_000_000)
    loaded: dict[str, Any] = json.loads(text)
    return loaded


def test_entry_of_a_card_has_all_keys_that_imager_requires_and_the_format_of_the_customisation(card: Path):
    (entry,) = made(card, card)["os_list"]
    assert [key for key in REQUIRED if key not in entry] == []
    assert entry["init_format"] == "cloudinit"  # without it, Imager offers no customisation
    assert entry["url"] == f"file://{card.parent}/a%20card.img"
    assert (entry["extract_size"], entry["image_download_size"]) == (4, 4)
    assert entry["extract_sha256"] == checksum.sha256(card)
    assert (entry["name"], entry["release_date"]) == ("captain 1.2.3", "2025-06-15")


def test_entry_of_a_compressed_card_has_the_sizes_of_both(card: Path):
    packed = card.with_suffix(".img.xz")
    packed.write_bytes(b"xz")
    (entry,) = made(card, packed)["os_list"]
    assert (entry["extract_size"], entry["image_download_size"]) == (4, 2)
    assert entry["url"].endswith("/a%20card.img.xz")


def test_devices_of_the_entry_are_tags_of_the_manifests_own_devices(card: Path):
    # else Imager lists no device, and hides the entry
    found = made(card, card)
    tags = {tag for device in found["imager"]["devices"] for tag in device["tags"]}
    assert set(found["os_list"][0]["devices"]) == tags


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda path, card: path.unlink(), "No such file"),
        (lambda path, card: path.write_text("{"), "cannot be read"),
        (lambda path, card: path.write_text('{"os_list": []}'), "cannot be read"),
        (lambda path, card: path.write_text("[]"), "cannot be read"),
        (lambda path, card: path.write_text(path.read_text().replace("file://", "file:///elsewhere")), "elsewhere"),
        (lambda path, card: card.write_bytes(b"other card"), "names"),
    ],
)
def test_manifest_that_does_not_name_the_card_has_trouble(card: Path, change: Any, said: str):
    path = card.with_suffix(manifest.SUFFIX)
    path.write_text(manifest.text(card, checksum.sha256(card), card, "1.2.3", 0))
    assert manifest.trouble(path, card) == ""
    change(path, card)
    assert said in manifest.trouble(path, card)
