"""PDUs from a user's text, files, folders and standard input, for `captain send`."""

import json
import os
import re
from base64 import b64decode
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple, TextIO

from board.errors import RequestError

# A station takes 1500 octets and refuses longer ones, which may be tried; this is for files of another kind.
MAX_OCTETS = 0xFFFF
MAX_FILE = 64 << 20  # octets: a million CAMs as JSON lines are read one by one, a binary file at once

FORMATS = ("hex", "base64", "binary", "json")
SUFFIXES = {
    ".hex": "hex",
    ".txt": "hex",
    ".b64": "base64",
    ".base64": "base64",
    ".bin": "binary",
    ".json": "json",
    ".jsonl": "json",
}
ACCEPTED = (
    "accepted are .hex and .txt (hexadecimal, one PDU a line), .b64 (base64, one a line), .bin (octets, one "
    'PDU), .json (objects like {"type": "cam", "hex": "0202..."}, in a list or one a line); or say --format'
)
TYPE = re.compile(r"[a-z0-9_]*")


class Payload(NamedTuple):
    """A PDU to send; type is empty where its header shall tell; origin says where it stood."""

    pdu: bytes
    type: str
    origin: str


def read(sources: Iterable[str], form: str | None, standard_input: TextIO) -> Iterator[Payload]:
    """The PDUs of files, folders, `-` for standard input, or text that is none of these: hexadecimal.

    form  one of FORMATS in place of what a file's name or the first character of standard input says.

    Raises RequestError that names the file, the line and the character.
    """
    for source in sources:
        if source == "-":
            yield from _standard_input(standard_input, form)
        elif os.path.isdir(source):
            yield from _folder(Path(source), form)
        elif os.path.exists(source) or _looks_like_a_path(source, form):
            yield from _file(Path(source), form)
        else:
            yield Payload(_decode(form or "hex")(source, "the argument"), "", "the argument")


def _looks_like_a_path(source: str, form: str | None) -> bool:
    """A name that exists no longer shall not be complained about as hexadecimal; base64 may hold slashes."""
    return form != "base64" and ("/" in source or Path(source).suffix in SUFFIXES)


def _folder(folder: Path, form: str | None) -> Iterator[Payload]:
    files = sorted(entry for entry in folder.iterdir() if entry.is_file())
    chosen = [entry for entry in files if form is not None or entry.suffix.lower() in SUFFIXES]
    if not chosen:
        raise RequestError(f"{folder}: none of its {len(files)} files is of a known kind", ACCEPTED)
    for entry in chosen:
        yield from _file(entry, form)


def _file(path: Path, form: str | None) -> Iterator[Payload]:
    kind = form or SUFFIXES.get(path.suffix.lower())
    if kind is None:
        raise RequestError(f"{path}: {path.suffix or 'a name without a suffix'} is no known kind of file", ACCEPTED)
    try:
        if path.stat().st_size > MAX_FILE:
            raise RequestError(f"{path}: {path.stat().st_size} octets are no file of PDUs", ACCEPTED)
        octets = path.read_bytes()
    except OSError as error:
        raise RequestError(f"{path}: {error.strerror}") from error
    if kind == "binary":
        yield Payload(_bounded(octets, str(path)), "", str(path))
        return
    try:
        text = octets.decode()
    except UnicodeDecodeError as error:
        raise RequestError(f"{path}: octet {error.start} is not text, which {kind} is", "--format binary?") from error
    yield from _texts(text.splitlines(), kind, str(path))


def _standard_input(stream: TextIO, form: str | None) -> Iterator[Payload]:
    where = "standard input"
    if form == "binary":
        yield Payload(_bounded(stream.buffer.read(MAX_OCTETS + 1), where), "", where)
        return
    try:
        first = next((line for line in stream if line.strip()), "")
        kind = form or ("json" if first.lstrip().startswith(("{", "[")) else "hex")
        yield from _texts(_chain(first, stream), kind, where)
    except UnicodeDecodeError as error:
        raise RequestError(f"{where}: it is not text", "--format binary?") from error


def _chain(first: str, rest: Iterable[str]) -> Iterator[str]:
    yield first
    yield from rest


def _texts(lines: Iterable[str], kind: str, where: str) -> Iterator[Payload]:
    if kind == "json":
        yield from _json(lines, where)
        return
    count = 0
    for number, line in enumerate(lines, 1):
        text = line.partition("#")[0].strip()
        if text:
            count += 1
            origin = f"{where}: line {number}"
            yield Payload(_decode(kind)(text, origin), "", origin)
    if not count:
        raise RequestError(f"{where}: it holds no PDU", ACCEPTED)


def _decode(kind: str) -> Callable[[str, str], bytes]:
    if kind == "base64":
        return base64_octets
    if kind == "hex":
        return hex_octets
    raise RequestError(f"an argument cannot be {kind}", "write it to a file, or to standard input with `-`")


def hex_octets(text: str, where: str, remedy: str = ACCEPTED) -> bytes:
    """Octets of hexadecimal digits, with blanks or colons between them as they please."""
    digits = text.removeprefix("0x")
    for at, letter in enumerate(digits, 1 + len(text) - len(digits)):
        if letter not in "0123456789abcdefABCDEF: \t":
            raise RequestError(f"{where}: character {at}, {letter!r}, is no hexadecimal digit", remedy)
    joined = re.sub("[: \t]", "", digits)
    if len(joined) % 2:
        raise RequestError(f"{where}: {len(joined)} hexadecimal digits; an octet has two")
    return _bounded(bytes.fromhex(joined), where)


def base64_octets(text: str, where: str) -> bytes:
    """Octets of strict base64, `+` and `/`, padded."""
    joined = text.strip()
    for at, letter in enumerate(joined.rstrip("="), 1):
        if not (letter.isascii() and (letter.isalnum() or letter in "+/")):
            raise RequestError(f"{where}: character {at}, {letter!r}, is not of base64")
    try:
        return _bounded(b64decode(joined, validate=True), where)
    except ValueError as error:
        raise RequestError(f"{where}: {len(joined)} characters are no whole base64: {error}") from error


def _bounded(octets: bytes, where: str) -> bytes:
    if not octets:
        raise RequestError(f"{where}: it has no octets")
    if len(octets) > MAX_OCTETS:
        raise RequestError(f"{where}: more than {MAX_OCTETS} octets are no PDU", "a station sends at most 1500")
    return octets


def _json(lines: Iterable[str], where: str) -> Iterator[Payload]:
    """One object a line, or one list or object over all lines."""
    numbered = ((number, line) for number, line in enumerate(lines, 1) if line.strip())
    number, first = next(numbered, (0, ""))
    if not number:
        raise RequestError(f"{where}: it holds no PDU", ACCEPTED)
    try:
        is_lines = isinstance(json.loads(first), dict)
    except (ValueError, RecursionError):
        is_lines = False  # the list goes on, or it is none: then it is refused below
    if is_lines:
        yield _item(_parse(first, f"{where}: line {number}"), f"{where}: line {number}")
        for number, line in numbered:
            yield _item(_parse(line, f"{where}: line {number}"), f"{where}: line {number}")
        return
    whole = _parse("\n".join([first, *(line for _, line in numbered)]), where)
    for at, item in enumerate(whole if isinstance(whole, list) else [whole]):
        yield _item(item, f"{where}: item {at}")


def _parse(text: str, where: str) -> object:
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, character {error.colno}"
        raise RequestError(f"{where}: it is not JSON: {error.msg} at {place}", ACCEPTED) from error
    except (ValueError, RecursionError) as error:
        raise RequestError(f"{where}: it is not JSON: {error}", ACCEPTED) from error


def _item(item: object, where: str) -> Payload:
    if not isinstance(item, dict):
        raise RequestError(f"{where}: {str(item)[:40]!r} is no object", ACCEPTED)
    kind = item.get("type", "")
    if not isinstance(kind, str) or not TYPE.fullmatch(kind.lower()):
        raise RequestError(f"{where}: type {kind!r} is no name of a type", "letters, digits and _, as in `cam`")
    for key, decode in (("hex", hex_octets), ("base64", base64_octets)):
        text = item.get(key)
        if isinstance(text, str):
            return Payload(decode(text, f"{where}: {key}"), kind.lower(), where)
    raise RequestError(f"{where}: it has neither `hex` nor `base64`", ACCEPTED)
