"""Parser of leap-seconds.list as published by the IERS, with its hash.

Source: the comments in the lists of the IERS and of NIST; ntp's ntpd/ntp_leapsec.c for the order of the hash.
"""

import os
import re
import stat
import time
from typing import NamedTuple

from board.runtime.errors import ConfigurationError
from board.time.scales import EPOCH, TAI_LEAD

MOST = 65_536  # octets; the lists of the IERS and of NIST have 5000 to 11 000

NTP_EPOCH = 2_208_988_800  # seconds from 1900-01-01, the epoch of the list, to 1970-01-01
DAY = 86_400

# Lines of the list: `#$` creation, `#@` expiry, `#h` SHA-1 in five words, which may lack leading zeros.
UPDATED, EXPIRES, HASH = "#$", "#@", "#h"
_STAMP = re.compile(r"\d{10,11}", re.ASCII)
_WORDS = re.compile(r"[0-9a-f]{1,8}(\s+[0-9a-f]{1,8}){4}", re.ASCII | re.IGNORECASE)
_ROW = re.compile(r"(\d{10,11})\s+(\d{1,3})\s*(#.*)?", re.ASCII)

HINT = "install the package tzdata; without a list, the receiver's or the built-in value is used"


class LeapList(NamedTuple):
    """Leap seconds of a list.

    changes  since 2004: Unix time of the midnight after each leap second, and 1 or -1.
    expires  Unix time of the list's expiry.
    """

    changes: tuple[tuple[int, int], ...]
    expires: int


def read_list(path: str) -> LeapList:
    """Read a list and verify its hash. Raises ConfigurationError if it is unreadable, damaged or contradictory."""
    import hashlib  # imported late: it takes 5 ms, and not every station has a list

    stamps: dict[str, str] = {}
    rows: list[tuple[int, int]] = []
    hashed = hashlib.sha1(usedforsecurity=False)
    for number, line in enumerate(map(str.strip, _text(path).split("\n")), 1):
        kind = line[:2]
        if kind in (UPDATED, EXPIRES, HASH):
            if kind in stamps:
                raise _wrong(path, number, f"a second line that begins with {kind}")
            stamps[kind] = line[2:].strip()
            if kind != HASH:
                hashed.update(stamps[kind].encode())
        elif line and not line.startswith("#"):
            row = _ROW.fullmatch(line)
            if row is None:
                raise _wrong(path, number, f"the line is neither a comment nor a leap second: {line[:60]!r}")
            rows.append((int(row[1]) - NTP_EPOCH, int(row[2])))
            hashed.update((row[1] + row[2]).encode())
    expires = _expires(path, stamps, hashed.hexdigest())
    return LeapList(_changes(path, rows, expires), expires)


def day(unix_s: int) -> str:
    """Return the day of a Unix time: 2026-06-28."""
    return time.strftime("%Y-%m-%d", time.gmtime(unix_s))


def _text(path: str) -> str:
    try:
        # A path that is not a regular file may be endless or block.
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with open(descriptor, "rb") as file:
            octets = file.read(MOST + 1) if stat.S_ISREG(os.fstat(descriptor).st_mode) else None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise ConfigurationError(f"{path}: the list of leap seconds cannot be read: {reason}", HINT) from None
    if octets is None:
        raise ConfigurationError(f"{path}: the list of leap seconds is not a file", HINT)
    if len(octets) > MOST:
        raise ConfigurationError(f"{path}: too long for a list of leap seconds: more than {MOST} octets", HINT)
    try:
        return octets.decode()
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path}: octet {error.start}: not UTF-8", HINT) from None


def _expires(path: str, stamps: dict[str, str], digest: str) -> int:
    for kind in (UPDATED, EXPIRES, HASH):
        if kind not in stamps:
            raise ConfigurationError(f"{path}: no line that begins with {kind}", HINT)
        if not (_WORDS if kind == HASH else _STAMP).fullmatch(stamps[kind]):
            raise ConfigurationError(f"{path}: {kind} {stamps[kind][:60]!r} is not {_FORMS[kind]}", HINT)
    said = "".join(word.zfill(8) for word in stamps[HASH].lower().split())
    if said != digest:
        raise ConfigurationError(f"{path}: SHA-1 mismatch: {digest}, expected {said}", HINT)
    if int(stamps[EXPIRES]) <= int(stamps[UPDATED]):
        raise ConfigurationError(f"{path}: the list's date of expiry is before its date of update", HINT)
    return int(stamps[EXPIRES]) - NTP_EPOCH


def _changes(path: str, rows: list[tuple[int, int]], expires: int) -> tuple[tuple[int, int], ...]:
    changes: list[tuple[int, int]] = []
    before: tuple[int, int] | None = None
    for midnight, tai in rows:
        if midnight % DAY:
            raise ConfigurationError(f"{path}: {midnight + NTP_EPOCH} is not midnight", HINT)
        if before is not None and (midnight <= before[0] or abs(tai - before[1]) != 1):
            raise ConfigurationError(f"{path}: {tai} s on {day(midnight)} cannot follow {before[1]} s", HINT)
        if before is not None and midnight > EPOCH:
            changes.append((midnight, tai - before[1]))
        before = (midnight, tai)
    then = [tai for midnight, tai in rows if midnight <= EPOCH]
    if then[-1:] != [TAI_LEAD - EPOCH]:
        raise ConfigurationError(f"{path}: TAI - UTC in 2004 is not {TAI_LEAD - EPOCH} s, as it must be", HINT)
    if before is not None and before[0] > expires:
        raise ConfigurationError(f"{path}: the list expires before its own last leap second, on {day(expires)}", HINT)
    return tuple(changes)


def _wrong(path: str, number: int, what: str) -> ConfigurationError:
    return ConfigurationError(f"{path}: line {number}: {what}", HINT)


_FORMS = {UPDATED: "seconds since 1900", EXPIRES: "seconds since 1900", HASH: "five hexadecimal words"}
