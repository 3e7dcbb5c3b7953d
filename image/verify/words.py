"""Searches a card for build paths and private keys."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from image.project import PROJECT
from image.tool import run

CHUNK = 16 << 20
OVERLAP = 4096  # octets of a chunk that are searched again with the next one: the length of the longest path
# PEM of any kind, also with a password: RFC 7468, 10 and 11; RFC 1421, 4.6; OpenSSH, PROTOCOL.key. The first line alone
# does not match, because each program that reads keys contains it.
PRIVATE_KEY = rb"-----BEGIN [A-Z0-9 ]{0,20}PRIVATE KEY-----\s{0,2}(?:Proc-Type:|[A-Za-z0-9+/]{16})"
KEY_OCTETS = 128  # octets of PEM text compared to recognise a key; 70 of them belong to the key itself
# Libraries of Debian that contain public test keys.
TESTED = re.compile(r"usr/lib/[^/]+/libgnutls\.so[.\d]*")


class Word(NamedTuple):
    """Octets that must not be on a card. pattern: expression for them; known: octets in which they are permitted."""

    what: str
    pattern: bytes
    known: bytes = b""


def unwanted(secret: bytes, known_keys: bytes) -> list[Word]:
    """Return the words to search for. secret: octets of the update key; known_keys: contents of the TESTED files."""
    words = [Word("the build's path", inside(PROJECT))]
    words += [Word(f"a mirror's name, {name}", re.escape(name.encode())) for name in mirrors()]
    words += [Word("a private key", PRIVATE_KEY, known_keys)]
    return [*words, Word("the key of updates", re.escape(secret))] if secret else words


def places(image: Path, words: Sequence[Word]) -> dict[str, int]:
    """Return the first offset of each word that an image contains; reads the image once."""
    found: dict[str, int] = {}
    with image.open("rb") as file:
        at, tail = 0, b""
        while octets := file.read(CHUNK):
            if octets.strip(b"\0"):
                for word in words:
                    place = _first(word, tail + octets, bool(tail)) if word.what not in found else -1
                    if place >= 0:
                        found[word.what] = at - len(tail) + place
            tail, at = octets[-OVERLAP:], at + len(octets)
    return found


def _first(word: Word, octets: bytes, begin: int) -> int:
    """Return the first offset, or -1. begin: 1 if the previous chunk has searched position 0, with the octet before."""
    for seen in re.compile(word.pattern).finditer(octets, begin):
        if octets[seen.start() : seen.start() + KEY_OCTETS] not in word.known:
            return seen.start()
    return -1


def inside(folder: Path) -> bytes:
    """Return a pattern for paths in a folder. It excludes longer paths and packed data that end with the folder's."""
    path = re.escape(bytes(folder)) + b"/"
    return path + rb"(?<![\w./+-]" + path + b")"  # begins with the plain path, because that is searched fast


def mirrors() -> list[str]:
    """Return the hosts of this machine's package archives."""
    sites = run(["apt-get", "indextargets", "--format", "$(SITE)", "Created-By: Packages"])
    hosts = {re.sub("^[a-z+]+://", "", line).split("/")[0] for line in sites.split()}
    return sorted(host for host in hosts if host)
