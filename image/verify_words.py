"""What must be nowhere on a card, in a file or beside one: where it was built, and anybody's private key."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from image.program import run
from image.project import PROJECT

CHUNK = 16 << 20
OVERLAP = 4096  # octets of a chunk that are seen again with the next one: a path may have as many
# PEM of any kind, also with a password: RFC 7468, 10 and 11; RFC 1421, 4.6; OpenSSH, PROTOCOL.key. What begins with
# none of a key is the first line alone, which is in each program that reads them.
PRIVATE_KEY = rb"-----BEGIN [A-Z0-9 ]{0,20}PRIVATE KEY-----\s{0,2}(?:Proc-Type:|[A-Za-z0-9+/]{16})"
KEY_OCTETS = 128  # of PEM, which tell a key from others: 70 of its own among them
# Libraries of Debian's with keys in them, which they test themselves with: everybody has those.
TESTED = re.compile(r"usr/lib/[^/]+/libgnutls\.so[.\d]*")


class Word(NamedTuple):
    """pattern: to search for. known: octets in which it is meant to be."""

    what: str
    pattern: bytes
    known: bytes = b""


def unwanted(secret: bytes, known_keys: bytes) -> list[Word]:
    """secret: octets of the key of updates. known_keys: files of TESTED."""
    words = [Word("the build's path", inside(PROJECT))]
    words += [Word(f"a mirror's name, {name}", re.escape(name.encode())) for name in mirrors()]
    words += [Word("a private key", PRIVATE_KEY, known_keys)]
    return [*words, Word("the key of updates", re.escape(secret))] if secret else words


def places(image: Path, words: Sequence[Word]) -> dict[str, int]:
    """The first octet of each that is there, by what it is: one pass over all of them."""
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
    """-1 where there is none. begin: what is at 0 was whole in the chunk before, with the octet before it."""
    for seen in re.compile(word.pattern).finditer(octets, begin):
        if octets[seen.start() : seen.start() + KEY_OCTETS] not in word.known:
            return seen.start()
    return -1


def inside(folder: Path) -> bytes:
    """A pattern of paths of files in it. Of /src other paths have a part, and so has packed data, once in a while."""
    path = re.escape(bytes(folder)) + b"/"
    return path + rb"(?<![\w./+-]" + path + b")"  # it begins with what is to be found: that is searched fast


def mirrors() -> list[str]:
    """Hosts that this machine has its packages from."""
    sites = run(["apt-get", "indextargets", "--format", "$(SITE)", "Created-By: Packages"])
    hosts = {re.sub("^[a-z+]+://", "", line).split("/")[0] for line in sites.split()}
    return sorted(host for host in hosts if host)
