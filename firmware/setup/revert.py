"""Change of a file, reverted with all that its owner has changed since.

The units are lines; those of cmdline.txt, which is one line, are its words. They are compared without spaces and ends
of lines, since an editor may have changed these.
"""

from difflib import SequenceMatcher
from typing import NamedTuple

Words = tuple[bytes, ...]


class Change(NamedTuple):
    """Change of one file. before: None if the file was absent."""

    before: bytes | None
    after: bytes


def reverted(now: bytes, change: Change, name: str) -> bytes:
    """Return a file without a change.

    now   content of the file, which others have changed.
    name  path of the file.
    """
    line = now.rstrip(b"\r\n")
    units = line.split(b" ") if _is_command_line(name) else now.splitlines(keepends=True)
    before, after = (_units(octets, name) for octets in change)
    old, new = [_words(one) for one in before], [_words(one) for one in after]
    for kind, first, last, begin, end in reversed(SequenceMatcher(None, old, new, False).get_opcodes()):
        if kind == "equal":
            continue
        ours = [at for one in reversed(new[begin:end]) for at in _remove(units, one, old.count(one))]
        at = min(ours, default=None) if begin < end else _after(units, new[:begin])
        if at is not None:  # else the owner has replaced our units
            found = [_words(one) for one in units]
            units[at:at] = [one for one in before[first:last] if found.count(_words(one)) < old.count(_words(one))]
    return b" ".join(units) + now[len(line) :] if _is_command_line(name) else b"".join(units)


def left(now: bytes, change: Change, name: str) -> str:
    """Return a line of the change that a file still has, perhaps with more words; empty without one."""
    before, after = ({_words(one) for one in _units(octets, name)} for octets in change)
    ours = [one for one in after - before if one and not _is_header(one) and not one[0].startswith(b"#")]
    found = (unit for unit in _units(now, name) if any(_words(unit)[: len(one)] == one for one in ours))
    return next(found, b"").decode("utf-8", "replace").strip()


def _units(octets: bytes | None, name: str) -> list[bytes]:
    octets = octets or b""
    return octets.split() if _is_command_line(name) else [line + b"\n" for line in octets.splitlines()]


def _is_command_line(name: str) -> bool:
    return name.endswith("cmdline.txt")


def _words(unit: bytes) -> Words:
    return tuple(unit.split())


def _is_header(words: Words) -> bool:
    """Return whether a line begins a part of the file: [all] of config.txt, [Service] of a unit."""
    return bool(words) and words[0].startswith(b"[")


def _remove(units: list[bytes], ours: Words, most: int) -> list[int]:
    """Remove the last copies of a unit until `most` are left, and return their indices.

    A header stays above other lines, which would come below another header without it.
    """
    places = [at for at, unit in enumerate(units) if ours and _words(unit) == ours][most:]
    if _is_header(ours):
        places = [at for at in places if not any(_words(unit) for unit in units[at + 1 :])]
    for at in reversed(places):
        del units[at]
    return places


def _after(units: list[bytes], above: list[Words]) -> int:
    """Return the index after the unit above; 0 without it."""
    words = [_words(unit) for unit in units]
    return words.index(above[-1]) + 1 if above and above[-1] in words else 0
