"""authorized_keys: each line as sshd will read it, and what people put there instead."""

import base64
import binascii
import re

from board.toml import show
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
# p and b of the curves, whose a is -3. Source: NIST SP 800-186, clause 3.2.1.
CURVES = {
    b"nistp256": (
        2**256 - 2**224 + 2**192 + 2**96 - 1,
        0x5AC635D8AA3A93E7B3EBBD55769886BC651D06B0CC53B0F63BCE3C3E27D2604B,
    ),
    b"nistp384": (
        2**384 - 2**128 - 2**96 + 2**32 - 1,
        0xB3312FA7E23EE7E4988E056BE3F82D19181D9C6EFE8141120314088F5013875AC656398D8A2ED19D2A85C8EDD3EC2AEF,
    ),
    b"nistp521": (
        2**521 - 1,
        0x51953EB9618E1C9A1F929A21A0B68540EEA2DA725B99B315F3B8B489918EF109E156193951EC7E937B1652C0BD3BB1BF073573DF883D2C34F1EF451FD46B503F00,
    ),
}
# A second key in the comment of a first: what `cat key.pub >>authorized_keys` makes of a file without an end of line.
GLUED = re.compile(r"(?:ssh-|ecdsa-|sk-)[a-z0-9@.-]+[ \t]+AAAA[A-Za-z0-9+/]{16,}=*")
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
    kind, written, comment = _words(line)
    if kind not in (*KINDS, OLD) and (options := _options(line)):
        kind, written, comment = _words(line.removeprefix(options).lstrip(BLANKS))
        if kind in KINDS and (trouble := ssh_options.trouble(options)) is not None:
            return trouble
    if kind == OLD:
        return "ssh-dss is no longer taken by sshd", "make another key: ssh-keygen -t ed25519"
    if kind.endswith(CERTIFICATE):
        remedy = "put the .pub file of the key here, or a line of its authority that begins with cert-authority"
        return "is a certificate, which belongs beside your private key", remedy
    if kind not in KINDS:
        return f"{show(line[:SHOWN])} begins no public key", f"is the line broken, or cut off? {MAKE}"
    try:
        octets = base64.b64decode(written, validate=True)
    except (binascii.Error, ValueError):
        return f"the key {_short(written)} is not base64", "copy the whole line once more, without breaks"
    fields = _fields(octets)
    if not _is_whole(kind, fields) or base64.b64encode(octets).decode() != written:
        return f"the key {_short(written)} is cut off or damaged", "copy the whole line once more, without breaks"
    if kind == "ssh-rsa" and (bits := int.from_bytes(fields[2]).bit_length()) < LEAST_RSA_BITS:
        return f"an RSA key of {bits} bits is refused by sshd", "make another key: ssh-keygen -t ed25519"
    if second := GLUED.search(comment):
        what = f"a second key begins in its comment, {_short(second[0].split()[1])}, which sshd does not see"
        return what, "write each key into a line of its own"
    return None


def _words(line: str) -> list[str]:
    """The first two, and what follows them."""
    return [*re.split(f"[{BLANKS}]+", line, maxsplit=2), "", "", ""][:3]


def _is_whole(kind: str, fields: list[bytes]) -> bool:
    if not fields or fields[0] != kind.encode() or len(fields) - 1 != len(SIZES[kind]):
        return False
    if "ecdsa" in kind and (fields[1] != re.findall("nistp[0-9]+", kind)[0].encode() or not _is_point(*fields[1:3])):
        return False
    return all(size in (None, len(field)) for field, size in zip(fields[1:], SIZES[kind], strict=True))


def _is_point(curve: bytes, octets: bytes) -> bool:
    """Whether a point is on its curve: y^2 = x^3 - 3x + b. Source: SEC 1, clause 2.3.4, uncompressed."""
    p, b = CURVES[curve]
    half = len(octets) // 2
    x, y = int.from_bytes(octets[1 : half + 1]), int.from_bytes(octets[half + 1 :])
    return octets[:1] == b"\4" and max(x, y) < p and (y * y - x * (x * x - 3) - b) % p == 0


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
