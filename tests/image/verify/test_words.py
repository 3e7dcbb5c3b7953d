"""Forbidden text on a card: build paths and private keys."""

import re
import subprocess
from pathlib import Path

import pytest

from image.description import read
from image.project import PROJECT
from image.verify import words as verify_words
from image.verify.card import FinishedCard
from image.verify.words import CHUNK, inside
from tests.said import of_key

OWN = read(PROJECT / "image/image.toml")
SECRET, KEY = b"MHcCAQEEIA+8/w==", b"-----BEGIN OPENSSH PRIVATE KEY-----\nb3BlbnNzaC1rZXktdjEAAAAA"


def told(path: Path, words: dict[int, bytes], monkeypatch: pytest.MonkeyPatch, known: bytes = b"") -> dict[str, str]:
    """What is said of the beginning of a card with words at octets of it."""
    monkeypatch.setattr(verify_words, "mirrors", lambda: ["deb.example"])
    with path.open("wb") as file:
        file.truncate(2 * CHUNK + 1000)
        for at, word in words.items():
            file.seek(at)
            file.write(word)
    return {row.check: row.trouble for row in FinishedCard(OWN, path, Path("/none"), SECRET)._unwanted_words(known)}


def test_words_of_the_build_and_keys_fail_with_their_place_wherever_they_lie(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    own = bytes(PROJECT) + b"/x"
    words = {1000: b"http://deb.example/", CHUNK - 3: own, 2 * CHUNK - 40: KEY, 2 * CHUNK + 900: SECRET}
    found = told(tmp_path / "card", words, monkeypatch)
    assert {word: of_key(found, word) for word in ("path", "deb.example", "private key", "key of updates")} == {
        "path": f"at octet {CHUNK - 3}, in boot",
        "deb.example": "at octet 1007, in no partition",
        "private key": f"at octet {2 * CHUNK - 40}, in boot",
        "key of updates": f"at octet {2 * CHUNK + 900}, in boot",
    }
    assert len(found) == 4


def test_what_only_looks_like_one_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    words = {0: b"debXexample", 100: KEY[:36] + b"...", CHUNK - 3: b"a" + bytes(PROJECT), 2 * CHUNK: SECRET[:-1]}
    assert set(told(tmp_path / "card", words, monkeypatch).values()) == {""}


def made(algorithm: list[str], ending: list[str]) -> bytes:
    """A key by openssl, as a person has one."""
    key = subprocess.run(["openssl", "genpkey", *algorithm], capture_output=True, check=True).stdout
    return subprocess.run(["openssl", *ending], input=key, capture_output=True, check=True).stdout


EC, RSA = (["-algorithm", *words] for words in (["EC", "-pkeyopt", "ec_paramgen_curve:P-256"], ["RSA"]))


@pytest.mark.parametrize(
    ("algorithm", "ending", "begin"),
    [
        (EC, ["pkey"], b"-----BEGIN PRIVATE KEY-----\n"),
        (EC, ["ec"], b"-----BEGIN EC PRIVATE KEY-----\n"),
        (RSA, ["rsa", "-traditional"], b"-----BEGIN RSA PRIVATE KEY-----\n"),
        (["-algorithm", "ED25519"], ["pkey"], b"-----BEGIN PRIVATE KEY-----\n"),
        (EC, ["pkey", "-aes256", "-passout", "pass:x"], b"-----BEGIN ENCRYPTED PRIVATE KEY-----\n"),
        (RSA, ["rsa", "-traditional", "-aes256", "-passout", "pass:x"], b"-----BEGIN RSA PRIVATE KEY-----\nProc-Type"),
    ],
)
def test_private_key_of_any_form_fails_with_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, algorithm: list[str], ending: list[str], begin: bytes
):
    key = made(algorithm, ending)
    assert key.startswith(begin)
    for form in (key, key.replace(b"\n", b"\r\n")):
        said = told(tmp_path / "card", {CHUNK - 20: form}, monkeypatch)
        assert of_key(said, "private key") == f"at octet {CHUNK - 20}, in boot"


def test_keys_of_a_library_that_tests_itself_pass_and_another_beside_them_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    everybodys, own = (made(EC, ["ec"]) for _ in range(2))
    library = b"\0" + everybodys + b"\0test_sig"
    words = {500: everybodys, CHUNK - 20: everybodys}
    assert of_key(told(tmp_path / "card", words, monkeypatch, library), "private key") == ""
    said = told(tmp_path / "card", {**words, CHUNK + 5000: own}, monkeypatch, library)
    assert of_key(said, "private key") == f"at octet {CHUNK + 5000}, in boot"
    said = told(tmp_path / "card", words, monkeypatch)
    assert of_key(said, "private key") == "at octet 500, in no partition"


@pytest.mark.parametrize("octets", [b"/src/image/root.py", b"\0\0/src/", b'file "/src/x.c"', b"=/src/firmware"])
def test_a_path_of_a_file_of_the_build_is_seen(octets: bytes):
    assert re.search(inside(Path("/src")), octets)


@pytest.mark.parametrize("octets", [b"drivers/acpi/src/x.c", b"a/src/", b"/src\x8f", b"/srcs/x", b"../src/x", b""])
def test_a_part_of_another_path_is_none(octets: bytes):
    assert not re.search(inside(Path("/src")), octets)
