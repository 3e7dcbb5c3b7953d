"""Object identifiers of modules, compared by their numbers, not by their spelling."""

import re
from typing import TypeAlias

Arc: TypeAlias = int | str

# Names that need no number, below each parent: ITU-T X.660 annex A, and the first arcs of ETSI's modules.
_BELOW: dict[tuple[Arc, ...], dict[str, int]] = {
    (): {"itu-t": 0, "ccitt": 0, "iso": 1, "joint-iso-itu-t": 2, "joint-iso-ccitt": 2},
    (0,): {
        "recommendation": 0,
        "question": 1,
        "administration": 2,
        "network-operator": 3,
        "identified-organization": 4,
    },
    (1,): {"standard": 0, "registration-authority": 1, "member-body": 2, "identified-organization": 3},
    (0, 4): {"etsi": 0},
    (0, 4, 0): {"itsDomain": 5},
}


def arcs(oid: str) -> tuple[Arc, ...]:
    """Return the arcs of `{ itu-t(0) ... version(2) }` as numbers; a name without a known number stays a name."""
    found: list[Arc] = []
    for word in words(oid):
        number = re.search(r"\d+(?=\)?$)", word if "(" in word or word.isdecimal() else "")
        known = _BELOW.get(tuple(found), {})
        found.append(int(number[0]) if number else known.get(word, word))
    return tuple(found)


def words(oid: str) -> list[str]:
    """Return the arcs as written: "version(2)"."""
    return oid.strip("{} ").split()


def behind(oid: str, common: int) -> str:
    """Return the arcs after the first `common` ones, at least the last one, as written: "version(2)"."""
    parts = words(oid)
    return " ".join(parts[min(common, len(parts) - 1) :]) if parts else "no object identifier"


def shared(oids: list[tuple[Arc, ...]]) -> int:
    """Return the number of leading arcs that all identifiers share."""
    same = [len(set(column)) == 1 for column in zip(*oids, strict=False)]
    return same.index(False) if False in same else len(same)


def is_successor(wanted: tuple[Arc, ...], found: tuple[Arc, ...]) -> bool:
    """Return whether only the last arc differs and is not smaller (WITH SUCCESSORS)."""
    if len(wanted) != len(found) or wanted[:-1] != found[:-1]:
        return False
    return isinstance(wanted[-1], int) and isinstance(found[-1], int) and found[-1] >= wanted[-1]


def is_descendant(wanted: tuple[Arc, ...], found: tuple[Arc, ...]) -> bool:
    """Return whether `found` equals `wanted`, is a successor of it, or is below one of these (WITH DESCENDANTS)."""
    return is_successor(wanted, found[: len(wanted)])
