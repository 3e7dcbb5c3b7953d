"""Line numbers of keys in a TOML file."""

import re
import tomllib
from functools import lru_cache

HEADER = re.compile(r"\s*\[(\[)?(.*?)\]\]?\s*(?:#.*)?$")
_PART = r"""(?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')"""
KEY = re.compile(rf"\s*({_PART}(?:\s*\.\s*{_PART})*)\s*=")
INDEX = re.compile(r"\[(\d+)\]")

Keys = tuple[str, ...]


def line_of(text: str, path: str) -> int | None:
    """Return the line, from 1, of a key such as `wifi.country` or `policy[1].match`; else that of the next table above.

    For a table without a line of its own, return that of the first key or table in it.

    path  path in the form of board.runtime.describe.
    """
    wanted = _keys(INDEX.sub(r".\1", path))
    places = _places(text)
    while wanted:
        if wanted in places:
            return places[wanted]
        wanted = wanted[:-1]
    return None


def syntax_hint(why: str) -> str:
    """Return the remedy for an error of the TOML parser."""
    if any(word in why for word in ("overwrite", "twice", "namespace", "Duplicate")):
        return "define each key and each [table] once; close { } and [ ]"
    if "value" in why.lower() or "digits" in why:
        return 'put text in quotes: key = "value"'
    return "compare with the examples of the guides"


@lru_cache(maxsize=4)  # for the files of a set, because a file may have thousands of mistakes
def _places(text: str) -> dict[Keys, int]:
    """Return the first line of each key; the names of arrays of tables are followed by a number."""
    found: dict[Keys, int] = {}
    below: dict[Keys, int] = {}
    table: Keys = ()
    counts: dict[Keys, int] = {}
    for number, line in enumerate(text.split("\n"), 1):
        if header := HEADER.match(line):
            name = _keys(header[2])
            if header[1]:
                counts[name] = counts.get(name, -1) + 1
                found.setdefault(name, number)
                name = (*name, str(counts[name]))
            elif name[:-1] in counts:  # a table inside the last element of an array
                name = (*name[:-1], str(counts[name[:-1]]), name[-1])
            table = name
            found.setdefault(table, number)
        elif key := KEY.match(line):
            name = (*table, *_keys(key[1]))
            found.setdefault(name, number)
        else:
            continue
        for depth in range(1, len(name)):
            below.setdefault(name[:depth], number)
    return below | found


def _keys(dotted: str) -> Keys:
    """Split a dotted key, which may have quoted parts."""
    keys: list[str] = []
    try:
        table: object = tomllib.loads(f"{dotted} = 0")
    except (ValueError, RecursionError):
        return tuple(dotted.split("."))
    while isinstance(table, dict) and len(table) == 1:
        ((key, table),) = table.items()
        keys.append(key)
    return tuple(keys)
