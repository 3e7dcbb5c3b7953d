"""TOML text into tables: a whole file, or one assignment of the command line; and how a value is shown."""

import ast
import re
import tomllib
from datetime import date, time
from pathlib import Path
from types import NoneType
from typing import Any

from board.errors import ConfigurationError

MAX_FILE = 1 << 20  # octets; a description is written by hand: what is longer is another file by mistake
MAX_SHOWN = 60  # characters of a wrong value
MAX_DEPTH = 3  # of tables and arrays that a message shows
MAX_PARTS = 64  # of a dotted key; a description has 5. For 20,000 the parser takes half a minute
_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_QUOTED = r"""(?:'(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")"""
_KEY_TUPLE = re.compile(rf"\({_QUOTED},(?: {_QUOTED}(?:, {_QUOTED})*)?\)")  # as Python writes one
# Whole and decimal: those with a point, an exponent or of another base have no limit.
_LONG_NUMBER = re.compile(r"""(?<![\w."'])[0-9](?:_?[0-9]){4300,}+(?![.eE])""")  # sys.get_int_max_str_digits()
_LONG_KEY = re.compile(rf"""(?<![\w"'-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{{MAX_PARTS}}}""")

# A boolean is also an int and must be asked for first; so must a datetime, which is a date.
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
    """The tables of a text. Raises ValueError, which tells the line as tomllib does, and RecursionError."""
    if found := _LONG_KEY.search(text):
        raise ValueError(f"a key has more than {MAX_PARTS} parts{_place(found)}")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(_in_words(str(error), text)) from error
    except ValueError as error:
        raise ValueError(f"a number has too many digits{_place(_LONG_NUMBER.search(text))}") from error


def _place(found: re.Match[str] | None) -> str:
    """As tomllib tells it."""
    return f" (at line {found.string.count(chr(10), 0, found.start()) + 1}, column 1)" if found else ""


def _in_words(said: str, text: str) -> str:
    """What tomllib says, with a line where it says the end of the document, and keys as they are written."""
    lines = text.rstrip().split("\n")
    said = said.replace("(at end of document)", f"(at line {len(lines)}, column {len(lines[-1]) + 1})")
    return _KEY_TUPLE.sub(lambda found: ".".join(_key(part) for part in ast.literal_eval(found[0])), said)


def load(path: str | Path) -> dict[str, Any]:
    """The tables of a TOML file. Raises ConfigurationError with the line: unreadable, not UTF-8, not TOML."""
    try:
        with open(path, "rb") as file:
            octets = file.read(MAX_FILE + 1)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        why = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise ConfigurationError(f"{path}: cannot be read: {why}", "name a TOML file that exists") from error
    if len(octets) > MAX_FILE:
        raise ConfigurationError(f"{path}: is longer than {MAX_FILE} octets", "is it a TOML file?")
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

    The value is TOML; a word that is not TOML is text, so that a name or an address needs no quotes.
    Raises ConfigurationError.
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
    """A value nearly as TOML writes it, shortened."""
    text = _written(value, depth)
    return text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + "..."


def _written(value: object, depth: int) -> str:
    match value:
        case None:
            return "null"  # as JSON has it; TOML has none
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
    except ValueError:  # an integer of more digits than Python writes
        return "the value"


def _key(name: object) -> str:
    """As a table has it: one of other letters than a bare key's in quotes."""
    return name if isinstance(name, str) and _BARE.fullmatch(name) else _written(name, 1)


def kind_name(value: object) -> str:
    """What a value is, in words."""
    return next(words for kind, words in NAMES.items() if isinstance(value, kind))


def _keys(dotted: str, where: str) -> list[str]:
    """The parts of a dotted key, quoted ones included."""
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
    """What selects a key in a table, or in an array that is long enough."""
    if isinstance(holder, dict):
        return key
    if isinstance(holder, list) and key.isdecimal() and int(key) < len(holder):
        return int(key)
    what = f"an array of {len(holder)}" if isinstance(holder, list) else f"{show(holder)}, {kind_name(holder)}"
    raise ConfigurationError(f"{where}: there is no {show(key)} in {what}")


def _parse(text: str, where: str) -> object:
    """The value of an override: read as an array, so that a comment or a second value makes it text."""
    values: list[object] = []
    try:
        if "\n" not in text:
            values = parse(f"value = [{text}]")["value"]
    except (ValueError, RecursionError) as error:
        if text.startswith(('"', "'", "[", "{")):
            raise ConfigurationError(f"{where}: {show(text)} is not TOML") from error
    return values[0] if len(values) == 1 else text
