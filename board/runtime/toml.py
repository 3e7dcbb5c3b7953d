"""Parses TOML, a file or one assignment, and formats values."""

import ast
import re
import tomllib
from datetime import date, time
from pathlib import Path
from types import NoneType
from typing import Any

from board.runtime.errors import ConfigurationError

MAX_FILE = 1 << 20  # octets; a description is written by hand, so a longer file is the wrong one
MAX_SHOWN = 60  # characters of a wrong value in a message
MAX_DEPTH = 3  # levels of tables and arrays that a message shows
MAX_PARTS = 64  # most parts of a dotted key; a description has 5. For 20,000 parts, the parser takes half a minute
_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_QUOTED = r"""(?:'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")"""
_KEY_TUPLE = re.compile(rf"\({_QUOTED},(?: {_QUOTED}(?:, {_QUOTED})*)?\)")  # a tuple of texts as Python prints it
# Only whole decimal numbers have a limit; numbers with a point, an exponent or another base have none.
_LONG_NUMBER = re.compile(r"""(?<![\w."'])[0-9](?:_?[0-9]){4300,}+(?![.eE])""")  # sys.get_int_max_str_digits()
_LONG_KEY = re.compile(rf"""(?<![\w"'-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{{MAX_PARTS}}}""")

# Order matters: a boolean is also an int, and comes before it; so does a datetime, which is a date.
NAMES: dict[type, str] = {
    bool: "true or false",
    int: "an integer",
    float: "a number",
    str: "text in quotes",
    tuple: "an array",
    list: "an array",
    dict: "a table",
    date: "a date",
    time: "a time",
    NoneType: "nothing",
}


def parse(text: str) -> dict[str, Any]:
    """Return the tables of a text. Raises ValueError with the line, as tomllib does, or RecursionError."""
    if found := _LONG_KEY.search(text):
        raise ValueError(f"a key has more than {MAX_PARTS} parts{_place(found)}")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(_in_words(str(error), text)) from error
    except ValueError as error:
        raise ValueError(f"a number has too many digits{_place(_LONG_NUMBER.search(text))}") from error


def _place(found: re.Match[str] | None) -> str:
    """Return the line of a match in the form that tomllib uses."""
    return f" (at line {found.string.count(chr(10), 0, found.start()) + 1}, column 1)" if found else ""


def _in_words(said: str, text: str) -> str:
    """Return tomllib's error with a line number for the end of the document, and with keys as TOML writes them."""
    lines = text.rstrip().split("\n")
    said = said.replace("(at end of document)", f"(at line {len(lines)}, column {len(lines[-1]) + 1})")
    return _KEY_TUPLE.sub(lambda found: ".".join(_key(part) for part in ast.literal_eval(found[0])), said)


def load(path: str | Path) -> dict[str, Any]:
    """Load a TOML file. Raises ConfigurationError with the line if it is unreadable, not UTF-8, or not TOML."""
    try:
        with open(path, "rb") as file:
            octets = file.read(MAX_FILE + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise ConfigurationError(f"{path}: cannot be read: {why}", "name a TOML file that exists") from error
    if len(octets) > MAX_FILE:
        raise ConfigurationError(f"{path}: is longer than {MAX_FILE} octets", "name a TOML file")
    try:
        return parse(octets.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = octets.count(b"\n", 0, error.start) + 1
        what = f"{path}: line {line}: octet 0x{error.object[error.start]:02x} is not UTF-8"
        raise ConfigurationError(what, "save the file as UTF-8") from error
    except ValueError as error:
        text, _, place = str(error).removesuffix(")").partition(" (at ")
        raise ConfigurationError(f"{path}: {place or 'not TOML'}: {text}") from error
    except RecursionError as error:
        raise ConfigurationError(f"{path}: arrays or tables are nested too deep") from error


def override(table: dict[str, Any], assignment: str, where: str = "--set") -> None:
    """Set one key of a table in place: `section.key=value`, or `policy.0.name=value` inside an array.

    The value is TOML; a word that is not TOML becomes text, so a name or an address needs no quotes. Raises
    ConfigurationError without `=`, for an unknown key or index, and for text in brackets or quotes that is not TOML.
    """
    name, is_assignment, text = assignment.partition("=")
    if not is_assignment:
        raise ConfigurationError(f"{where} {assignment}: has no value", "write section.key=value")
    place = f"{where} {name.strip()}"
    *path, last = _keys(name.strip(), place)
    holder: Any = table
    for key in path:
        index = _index(holder, key, place)
        holder = holder[index] if isinstance(holder, list) else holder.setdefault(index, {})
    holder[_index(holder, last, place)] = _parse(text.strip(), place)


def show(value: object, depth: int = MAX_DEPTH) -> str:
    """Format a value similar to TOML, shortened to MAX_SHOWN characters."""
    text = _written(value, depth)
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + "..."


def _written(value: object, depth: int) -> str:
    match value:
        case None:
            return "null"  # the word of JSON; TOML has no such value
        case bool():
            return "true" if value else "false"
        case str():
            return '"' + repr(value)[1:-1] + '"'
        case dict() | list() if depth == 0:
            return "..."
        case dict():
            return "{" + ", ".join(f"{_key(key)} = {show(item, depth - 1)}" for key, item in value.items()) + "}"
        case list():
            return "[" + ", ".join(show(item, depth - 1) for item in value) + "]"
    try:
        return str(value)
    except ValueError:  # the integer has more digits than Python prints
        return "the value"


def _key(name: object) -> str:
    """Format a key as in a table: in quotes unless it is a bare key."""
    return name if isinstance(name, str) and _BARE.fullmatch(name) else _written(name, 1)


def kind_name(value: object) -> str:
    """Return the type of a value in words."""
    return next(words for kind, words in NAMES.items() if isinstance(value, kind))


def _keys(dotted: str, where: str) -> list[str]:
    """Split a dotted key, which may have quoted parts."""
    keys = []
    try:
        table: Any = parse(f"{dotted} = 0") if "\n" not in dotted else {}
    except (ValueError, RecursionError):
        table = {}
    while isinstance(table, dict) and len(table) == 1:
        ((key, table),) = table.items()
        keys.append(key)
    if not keys:
        raise ConfigurationError(f"{where}: is not a key", "write section.key=value")
    return keys


def _index(holder: object, key: str, where: str) -> Any:
    """Return the index of a key: the key itself in a table, a number in an array. Raises ConfigurationError if none."""
    if isinstance(holder, dict):
        return key
    if isinstance(holder, list) and key.isdecimal() and int(key) < len(holder):
        return int(key)
    what = f"an array of {len(holder)}" if isinstance(holder, list) else f"{show(holder)}, {kind_name(holder)}"
    raise ConfigurationError(f"{where}: unknown key {show(key)} in {what}")


def _parse(text: str, where: str) -> object:
    """Parse the value of an override. It is read as an array: a second value or a comment makes the whole text."""
    values: list[object] = []
    try:
        if "\n" not in text:
            values = parse(f"value = [{text}]")["value"]
    except (ValueError, RecursionError) as error:
        if text.startswith(('"', "'", "[", "{")):
            raise ConfigurationError(f"{where}: {show(text)} is not TOML") from error
    return values[0] if len(values) == 1 else text
