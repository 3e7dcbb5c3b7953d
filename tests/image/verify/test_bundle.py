"""Findings in an update that a card would refuse."""

import random
from pathlib import Path

import pytest

from image.card import bundle, keys
from image.description import read
from image.project import PROJECT
from image.verify import bundle as verify_bundle

OWN = read(PROJECT / "image/image.toml")
EPOCH = 1_700_000_000  # 2023-11-14T22:13:20Z


@pytest.fixture(scope="module")
def signer(tmp_path_factory: pytest.TempPathFactory) -> keys.Keys:
    return keys.development(tmp_path_factory.mktemp("keys"), EPOCH)


@pytest.fixture(scope="module")
def update(signer: keys.Keys, tmp_path_factory: pytest.TempPathFactory) -> Path:
    contents = tmp_path_factory.mktemp("update") / "contents"
    contents.mkdir()
    (contents / bundle.NAME).write_bytes(random.Random(1).randbytes(40_000))
    bundle.write(contents, OWN.compatible, "1.2.3", EPOCH, signer, contents.with_suffix(".raucb"))
    return contents.with_suffix(".raucb")


def troubles(version: str, update: Path, signer: keys.Keys) -> list[str]:
    checks = verify_bundle.checks(OWN, version, update, signer.keyring.read_bytes())
    return [trouble for _, trouble in checks if trouble]


def test_the_update_of_a_card_has_no_trouble(update: Path, signer: keys.Keys):
    assert troubles("1.2.3", update, signer) == []


def test_an_update_of_another_version_is_told(update: Path, signer: keys.Keys):
    assert troubles("1.3.0", update, signer) == ["MF_VERSION is '1.2.3', not '1.3.0'"]


def test_an_update_that_somebody_else_signed_is_told(update: Path, tmp_path: Path):
    (trouble,) = troubles("1.2.3", update, keys.development(tmp_path / "other", EPOCH))
    assert "signature" in trouble


def test_an_update_that_was_cut_short_is_told(update: Path, signer: keys.Keys, tmp_path: Path):
    path = tmp_path / "short.raucb"
    path.write_bytes(update.read_bytes()[:-100])
    assert len(troubles("1.2.3", path, signer)) == 1
