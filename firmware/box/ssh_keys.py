"""authorized_keys: each line as sshd will read it, and what people put there instead."""

import base64
import binascii
import re

from firmware.box import ssh_options
from firmware.box.note import Note, at, mistake
from firmware.box.ssh_options import QUOTED, SHOWN, Trouble

# sshd(8), AUTHORIZED_KEYS FILE FORMAT; what OpenSSH 10 takes by default.
KINDS = (
    "ssh-ed25519", "ecdsa-sha2-nistp256", "ecdsa-sha2-nistp384", "ecdsa-sha2-nistp521", "ssh-rsa",
    "sk-ssh-ed25519@openssh.com", "sk-ecdsa-sha2-nistp256@openssh.com",
)  # fmt: skip
OLD = "ssh-dss"
LEAST_RSA_BITS = 1024  # RequiredRSASize of sshd_config(5)
BLANKS = " \t"  # between words; any other letter is part of one
# A word of options: letters, and values in quotes, in which blanks are not its end.
OPTIONS = re.compile(rf'(?:[^ \t"]|{QUOTED})+')
# Octets of each field behind the kind; None: any number. Sources: RFC 4253, clause 6.6; RFC 5656, clause 3.1; RFC 8709,
# clause 4; OpenSSH's PROTOCOL.u2f.
SIZES: dict[str, tuple[int | None, ...]] = {
    "ssh-ed25519": (32,),
    "ssh-rsa": (None, None),
    "ecdsa-sha2-nistp256": (8, 65),
    "ecdsa-sha2-nistp384": (8, 97),
    "ecdsa-sha2-nistp521": (8, 133),
    "sk-ssh-ed25519@openssh.com": (32, None),
    "sk-ecdsa-sha2-nistp256@openssh.com": (8, 65, None),
}
CERTIFICATE = "-cert-v01@openssh.com"
MAKE = "a line of authorized_keys is what `ssh-keygen -t ed25519` writes into id_ed25519.pub"


def sound_keys(name: str, text: str, notes: list[Note], first: int = 1) -> list[str]:
    """The lines that sshd takes; each of the others is noted. first: number of the text's first line."""
    found = []
    for number, line in enumerate(text.split("\n"), first):
        word = line.strip()
        if "PRIVATE KEY" in word or word.startswith("PuTTY-User-Key-File"):
            what = "is a private key, which belongs on your own computer only"
            notes.append(mistake(at(name, number), what, "put the file that ends in .pub here, and make a new pair"))
            break  # what follows is the rest of it
        if word.startswith("---- BEGIN SSH2"):
            remedy = "turn it into one line: ssh-keygen -i -f FILE"
            notes.append(mistake(at(name, number), "is a public key in PuTTY's form", remedy))
            break
        if not word or word.startswith("#"):
            continue
        if trouble := _trouble(word):
            notes.append(mistake(at(name, number), *trouble))
        else:
            found.append(word)
    return found


def shut(line: str, now: float) -> str:
    """Why nobody gets in by a line that sshd takes, and by nothing else; empty where somebody does.

    now  Unix time.
    """
    return ssh_options.shut(_options(line), now)


def named(line: str) -> str:
    """A line that sshd takes, for people: its key's beginning and end."""
    return _short(_words(line.removeprefix(_options(line)).lstrip(BLANKS))[1])


def _options(line: str) -> str:
    """Those before the kind of key."""
    options = OPTIONS.match(line)
    return options[0] if options and not (options[0] in KINDS or options[0].endswith(CERTIFICATE)) else ""


def _trouble(line: str) -> Trouble | None:
    """What is wrong with a line, and what to do; None where sshd takes it."""
    kind, written = _words(line)
    if kind not in (*KINDS, OLD) and (options := _options(line)):
        kind, written = _words(line.removeprefix(options).lstrip(BLANKS))
        if kind in KINDS and (trouble := ssh_options.trouble(options)) is not None:
            return trouble
    if kind == OLD:
        return "ssh-dss is no longer taken by sshd", "make another key: ssh-keygen -t ed25519"
    if kind.endswith(CERTIFICATE):
        remedy = "put the .pub file of the key here, or a line of its authority that begins with cert-authority"
        return "is a certificate, which belongs beside your private key", remedy
    if kind not in KINDS:
        return f'"{line[:SHOWN]}" begins no public key', f"is the line broken, or cut off? {MAKE}"
    try:
        octets = base64.b64decode(written, validate=True)
    except (binascii.Error, ValueError):
        return f"the key {_short(written)} is not base64", "copy the whole line once more, without breaks"
    fields = _fields(octets)
    if not _is_whole(kind, fields):
        return f"the key {_short(written)} is cut off or damaged", "copy the whole line once more, without breaks"
    if kind == "ssh-rsa" and (bits := int.from_bytes(fields[2]).bit_length()) < LEAST_RSA_BITS:
        return f"an RSA key of {bits} bits is refused by sshd", "make another key: ssh-keygen -t ed25519"
    return None


def _words(line: str) -> list[str]:
    """The first two."""
    return [*re.split(f"[{BLANKS}]+", line, maxsplit=2), "", ""][:2]


def _is_whole(kind: str, fields: list[bytes]) -> bool:
    if not fields or fields[0] != kind.encode() or len(fields) - 1 != len(SIZES[kind]):
        return False
    if "ecdsa" in kind and fields[1] != re.findall("nistp[0-9]+", kind)[0].encode():
        return False
    return all(size in (None, len(field)) for field, size in zip(fields[1:], SIZES[kind], strict=True))


def _fields(octets: bytes) -> list[bytes]:
    """The strings of a key; none where one is cut off. Source: RFC 4253, clause 6.6; RFC 4251, clause 5."""
    found, place = [], 0
    while place < len(octets):
        size = int.from_bytes(octets[place : place + 4])
        place += 4 + size
        if place > len(octets):
            return []
        found.append(octets[place - size : place])
    return found


def _short(written: str) -> str:
    return f"{written[:8]}...{written[-6:]}" if len(written) > SHOWN else f'"{written}"'
