"""Keys of updates, and bundles signed by them; the build machine's rauc makes and reads them."""

import os
import random
import struct
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import pytest

from image.card import bundle, keys
from image.errors import ImageError

EPOCH = 1_700_000_000  # 2023-11-14T22:13:20Z
WORDS = "captain trixie quad"


def field(certificate: Path, name: str) -> str:
    said = subprocess.run(
        ["openssl", "x509", "-in", certificate, "-noout", f"-{name}"], capture_output=True, text=True, check=True
    )
    return said.stdout.strip().partition("=")[2]


def made(folder: Path, name: str, signer: keys.Keys, content: bytes = random.Random(1).randbytes(40_000)) -> Path:
    contents = folder / name
    contents.mkdir(parents=True)
    (contents / bundle.NAME).write_bytes(content)
    bundle.write(contents, WORDS, "1.2.3", EPOCH, signer, folder / f"{name}.raucb")
    return folder / f"{name}.raucb"


def test_a_development_key_is_made_once_and_is_valid_from_the_builds_epoch_on(tmp_path: Path):
    first = keys.chosen(tmp_path, EPOCH, {})
    assert first == keys.chosen(tmp_path, EPOCH + 1, {})
    assert first.kind == keys.DEVELOPMENT
    assert datetime.strptime(field(first.certificate, "startdate"), "%b %d %H:%M:%S %Y GMT").replace(
        tzinfo=UTC
    ) == datetime.fromtimestamp(EPOCH, UTC)
    assert field(first.certificate, "enddate") == "Dec 31 23:59:59 9999 GMT"
    assert Path(first.key).stat().st_mode & 0o777 == 0o600
    assert {path.name for path in tmp_path.iterdir()} == {"development.key.pem", "development.cert.pem"}


def test_the_key_of_a_card_that_was_built_is_found_and_none_is_made(tmp_path: Path):
    with pytest.raises(ImageError, match=r"development\.cert\.pem: missing"):
        keys.kept(tmp_path / "none", {})
    assert not (tmp_path / "none").exists()
    made = keys.chosen(tmp_path / "keys", EPOCH, {})
    assert keys.kept(tmp_path / "keys", {}) == made
    given = {keys.KEY: made.key, keys.CERTIFICATE: str(made.certificate)}
    assert keys.kept(tmp_path / "none", given).kind == keys.RELEASE


def test_two_build_folders_have_two_keys_and_one_can_tell_them_apart(tmp_path: Path):
    found = [keys.development(tmp_path / name, EPOCH) for name in "ab"]
    assert keys.subject(found[0].certificate) != keys.subject(found[1].certificate)
    assert keys.secret(found[0]) != keys.secret(found[1])
    assert keys.secret(found[0]) in Path(found[0].key).read_bytes()


def test_a_release_key_is_taken_from_the_environment_and_no_development_key_is_made(tmp_path: Path):
    own = keys.development(tmp_path / "safe", EPOCH)
    given = {keys.KEY: own.key, keys.CERTIFICATE: str(own.certificate)}
    assert keys.chosen(tmp_path / "keys", EPOCH, given) == keys.Keys(
        keys.RELEASE, own.key, own.certificate, own.certificate
    )
    assert not (tmp_path / "keys").exists()


def test_a_key_in_hardware_is_named_and_never_read(tmp_path: Path):
    own = keys.development(tmp_path, EPOCH)
    uri = "pkcs11:token=release;object=updates"
    found = keys.chosen(tmp_path, EPOCH, {keys.KEY: uri, keys.CERTIFICATE: str(own.certificate)})
    assert (found.kind, found.key, keys.secret(found)) == (keys.RELEASE, uri, b"")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({keys.KEY: "/k"}, "CAPTAIN_RELEASE_CERT is not set"),
        ({keys.CERTIFICATE: "/c"}, "CAPTAIN_RELEASE_KEY is not set"),
        ({keys.KEYRING: "/r"}, "CAPTAIN_RELEASE_KEYRING is set, but no key to sign with"),
        ({keys.KEY: "/none/k", keys.CERTIFICATE: "/none/c"}, "/none/c: not found"),
    ],
)
def test_half_a_release_key_is_no_development_build(tmp_path: Path, given: dict[str, str], said: str):
    with pytest.raises(ImageError, match=said):
        keys.chosen(tmp_path, EPOCH, given)


def test_two_bundles_of_one_slot_differ_only_behind_their_contents(tmp_path: Path):
    signer = keys.development(tmp_path / "keys", EPOCH)
    first, second = (made(tmp_path, name, signer).read_bytes() for name in "ab")
    # squashfs 4.0, superblock: octets in use, at 40; rauc fills the last block.
    (size,) = struct.unpack_from("<Q", first, 40)
    assert first[:size] == second[:size]
    assert len(first) == len(second) or abs(len(first) - len(second)) < 8  # an ECDSA signature is 70 to 72 octets


def test_a_bundle_is_taken_by_a_box_of_its_key_and_refused_by_one_of_another(tmp_path: Path):
    own, other = (keys.development(tmp_path / name, EPOCH) for name in ("own", "other"))
    path = made(tmp_path, "update", own)

    def looked(keyring: Path) -> "subprocess.CompletedProcess[str]":
        words = ["rauc", f"--keyring={keyring}", "info", path]
        return subprocess.run(words, capture_output=True, text=True, check=False, env={**os.environ, "LC_ALL": "C"})

    said = looked(own.keyring)
    assert f"'{WORDS}'" in said.stdout, said
    assert looked(other.keyring).returncode == 1


def test_a_bundle_that_cannot_be_signed_is_told(tmp_path: Path):
    own = keys.development(tmp_path / "keys", EPOCH)
    wrong = own._replace(key=str(tmp_path / "none.pem"))
    with pytest.raises(ImageError, match=r"none\.pem"):
        made(tmp_path, "update", wrong)
