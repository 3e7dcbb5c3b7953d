"""Public keys of authorized_keys, checked by ssh-keygen."""

import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping

from board.runtime.errors import StationError
from board.runtime.toml import show
from board.runtime.tool import environment
from firmware.card.note import Note, at, mistake, remark

PROGRAM = "ssh-keygen"
LIMIT_S = 20.0  # 800 keys, as many as fit into a file, take 0.1 s
# sshd(8), AUTHORIZED_KEYS FILE FORMAT; types that OpenSSH 10 accepts by default. AAAA: length of the type, in Base64.
KEY = re.compile(
    r"(?:ssh-ed25519|ssh-rsa|ecdsa-sha2-nistp(?:256|384|521)|sk-(?:ssh-ed25519|ecdsa-sha2-nistp256)@openssh\.com)"
    r"[ \t]+(AAAA[^ \t]*)"
)
# sshd(8): names of options in any case; values escape only quotes.
OPTION = (
    r"(?i:restrict|cert-authority|(?:no-)?(?:(?:agent|port|X11)-forwarding|pty|user-rc|(?:touch|verify)-required)"
    r'|(?:command|environment|expiry-time|from|permitlisten|permitopen|principals|tunnel)="(?:[^"\\]|\\"|\\(?!"))*")'
)
OPTIONS = re.compile(rf"(?:{OPTION}(?=[, \t])|,)+[ \t]+")  # OpenSSH 9.2 also accepts commas without an option
OLD = re.compile(r"(?<![a-z0-9-])(ssh-dss|[a-z0-9-]+-cert-v01@openssh\.com)[ \t]+AAAA")
SOUND = re.compile(r" line-(\d+) \([A-Z0-9-]+\)$", re.MULTILINE)
REFUSED = "is not a public key file"  # ssh-keygen's message if no line is a key
SHOWN, MOST_SAID = 24, 80  # most characters shown of a line, and of ssh-keygen's message
ELSEWHERE = "check the card as another user or on another computer"
PRIVATE = (
    "is a private key, which must stay on your own computer",
    "make a new key pair, and put its .pub file here",
)
ANEW = "make a new key pair: ssh-keygen -t ed25519"
MAKE = "use the line that `ssh-keygen -t ed25519` writes into id_ed25519.pub"


def sound_keys(name: str, texts: Iterable[tuple[int, str]], notes: list[Note]) -> list[str]:
    """Return the lines that are public keys; report each of the others.

    texts  texts from the file `name`, each with the number of its first line.

    Values of options are not checked here: sshd's journal names those that it refuses.
    """
    found = [line for first, text in texts for line in _written(name, first, text, notes)]
    single = {index: key for index, (_, line) in enumerate(found) if (key := _key(line)) and not _second(line, key)}
    try:
        sound = _asked({index: key[0] for index, key in single.items()})
    except StationError as error:
        notes.append(remark(name, f"the keys were not checked: {error.message}", error.hint))
        sound = set(single)
    notes += [
        mistake(at(name, number), *_trouble(line)) for index, (number, line) in enumerate(found) if index not in sound
    ]
    return [line for index, (_, line) in enumerate(found) if index in sound]


def short(line: str) -> str:
    """Return the beginning and the end of the key in a line."""
    key = _key(line)
    assert key is not None
    return _ends(key)


def _written(name: str, first: int, text: str, notes: list[Note]) -> Iterator[tuple[int, str]]:
    """Yield lines that may be public keys, with their numbers; at a file of another kind of key, report it and stop."""
    for number, line in ((number, line.strip()) for number, line in enumerate(text.split("\n"), first)):
        if "PRIVATE KEY" in line or line.startswith("PuTTY-User-Key-File"):
            notes.append(mistake(at(name, number), *PRIVATE))
            return  # the next lines belong to the private key
        if line.startswith("---- BEGIN SSH2"):
            remedy = "turn it into one line: ssh-keygen -i -f FILE"
            notes.append(mistake(at(name, number), "is a public key in PuTTY's form", remedy))
            return
        if line and not line.startswith("#"):
            yield number, line


def _key(line: str) -> re.Match[str] | None:
    """Return the key at the beginning of a line, or after its options; None if sshd would find no key."""
    options = OPTIONS.match(line)
    return KEY.match(line, options.end() if options else 0)


def _second(line: str, key: re.Match[str]) -> bool:
    """Return whether another key follows, as after appending to a file without a final line end."""
    return KEY.search(line, key.end()) is not None


def _ends(key: re.Match[str]) -> str:
    return f"{key[1][:8]}...{key[1][-6:]}" if len(key[1]) > SHOWN else f'"{key[1]}"'


def _asked(keys: Mapping[int, str]) -> set[int]:
    """Return the indices of the keys that ssh-keygen accepts. It prints comments, so these carry the indices.

    Raises StationError if ssh-keygen is missing, exceeds LIMIT_S, or fails for a reason other than the keys.
    """
    if not keys:
        return set()
    text = "".join(f"{key} line-{index}\n" for index, key in keys.items())
    try:
        ended = subprocess.run(
            [PROGRAM, "-l", "-f", "-"],
            input=text.encode(),
            capture_output=True,
            timeout=LIMIT_S,
            check=False,
            env=environment(),
        )
    except OSError as error:
        raise StationError(f"{PROGRAM} does not run here", "install openssh-client") from error
    except subprocess.TimeoutExpired as error:
        raise StationError(f"{PROGRAM}: timeout after {LIMIT_S:.0f} s", ELSEWHERE) from error
    found = {int(index) for index in SOUND.findall(ended.stdout.decode(errors="replace"))}
    said = ended.stderr.decode(errors="replace")
    if ended.returncode and not found and REFUSED not in said:
        raise StationError(f"{PROGRAM} fails: {show(said.strip()[:MOST_SAID])}", ELSEWHERE)
    return found


def _trouble(line: str) -> tuple[str, str]:
    """Return the fault of an invalid line, and the remedy."""
    if key := _key(line):
        if _second(line, key):
            return "has more than one key; sshd reads only the first", "write one key per line"
        if key[0].startswith("ssh-rsa"):
            what = f"the key {_ends(key)} is truncated, damaged or shorter than 1024 bits"
            return what, f"copy the whole line again, without breaks, or {ANEW}"
        return f"the key {_ends(key)} is truncated or damaged", "copy the whole line again, without breaks"
    if old := OLD.search(line):
        return f"{old[1]} is refused by sshd", f"put the .pub file of another key here, or {ANEW}"
    if key := KEY.search(line):
        what = f"{show(line[: key.start()][-SHOWN:])} before the key {_ends(key)}: invalid options"
        return what, "begin the line with the key, or with options of sshd(8) with quoted values"
    return f"{show(line[:SHOWN])} is not a public key", f"copy the whole line again, without breaks: {MAKE}"
