"""Payloads for `captain send`: PDUs from text, files, folders and standard input."""

import errno
import json
import os
import re
from base64 import b64decode
from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeAlias

from board.runtime.errors import RequestError
from firmware import file_remedy
from firmware.client.sending import json_texts
from firmware.facilities.exchange import MAX_BODY
from firmware.topics import type_name

# A station accepts 1500 octets. Longer PDUs are allowed, to test its refusal; this limit only rejects files of another
# kind.
MAX_OCTETS = 0xFFFF
MAX_FILE = 64 << 20  # octets of a binary file; text is read line by line

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
    "known are .hex and .txt (hexadecimal, one PDU per line); .b64 (base64, one per line); .bin (octets, one PDU); "
    ".json (objects of `captain decode --json` or `captain listen --json`, in a list or one per line); for others use "
    "--format"
)
NAME_ONE = "name a file that exists, or give the PDU in hexadecimal; for base64 say --format base64"
HEXADECIMAL = frozenset("0123456789abcdefABCDEF: \t")
TYPE = re.compile(r"[a-z0-9_]*")


class Payload(NamedTuple):
    """Message to send.

    pdu     octets of the PDU, or of a JSON object.
    type    message type; empty: the station classifies the message by its header or edition.
    origin  place in the input, such as file and line.
    form    "octets", or the form of the JSON object: "json" or "plain".
    """

    pdu: bytes
    type: str
    origin: str
    form: str = "octets"


Item: TypeAlias = Payload | RequestError


def read(sources: Iterable[str], form: str | None, standard_input: BinaryIO) -> Iterator[Item]:
    """Yield the messages of each source: a file, a folder, `-` for standard input, hexadecimal, or a JSON object.

    form  one of FORMATS; overrides the format found from a file's suffix or from the start of standard input.

    An invalid PDU is yielded as an error with file, line and character, so that reading continues with the next one.
    """
    for source in sources:
        yield from _all_of(_source(source, form, standard_input))


def _all_of(items: Iterator[Item]) -> Iterator[Item]:
    """Yield the items of one source; an error that ends the source becomes its last item."""
    try:
        yield from items
    except RequestError as error:
        yield error


def _source(source: str, form: str | None, standard_input: BinaryIO) -> Iterator[Item]:
    if source == "-":
        yield from _standard_input(standard_input, form)
    elif os.path.isdir(source):
        yield from _folder(Path(source), form)
    elif source.lstrip().startswith("{"):
        yield from _json([source.encode()], "the argument")
    elif os.path.exists(source) or _looks_like_a_path(source, form):
        yield from _file(Path(source), form)
    else:
        yield Payload(_decode(form or "hex")(source, "the argument"), "", "the argument")


def _looks_like_a_path(source: str, form: str | None) -> bool:
    """Whether a text is more likely the name of a missing file than a PDU.

    A PDU begins with protocolVersion, a small number, so mistyped hexadecimal also begins with a digit. Base64 may
    contain slashes, but no dot.
    """
    if form == "base64":
        return "." in source
    is_word = source[:1].isascii() and source[:1].isalpha() and set(source) - HEXADECIMAL
    return "." in source or "/" in source or (form in (None, "hex") and bool(is_word))


def _folder(folder: Path, form: str | None) -> Iterator[Item]:
    try:
        files = sorted(entry for entry in folder.iterdir() if entry.is_file())
    except OSError as error:
        raise RequestError(f"{folder}: {error.strerror}", file_remedy.to_read(error)) from error
    chosen = [entry for entry in files if form is not None or entry.suffix.lower() in SUFFIXES]
    if not chosen:
        raise RequestError(f"{folder}: none of its {len(files)} files has a known suffix", ACCEPTED)
    for entry in chosen:
        yield from _all_of(_file(entry, form))


def _file(path: Path, form: str | None) -> Iterator[Item]:
    kind = form or SUFFIXES.get(path.suffix.lower())
    try:
        size = path.stat().st_size
        if kind is None:
            named = path.suffix or "a name without a suffix"
            raise RequestError(f"{path}: {named} is not a known kind of file", ACCEPTED)
        if size > MAX_FILE:
            raise RequestError(f"{path}: {size} octets: too large for a file of one PDU", ACCEPTED)
        octets = path.read_bytes()
    except OSError as error:
        remedy = NAME_ONE if error.errno == errno.ENOENT else file_remedy.to_read(error)
        raise RequestError(f"{path}: {error.strerror}", remedy) from error
    if kind == "binary":
        yield Payload(_bounded(octets, str(path)), "", str(path))
        return
    yield from _texts(octets.splitlines(keepends=True), kind, str(path))


def _standard_input(stream: BinaryIO, form: str | None) -> Iterator[Item]:
    where = "standard input"
    if form == "binary":
        yield Payload(_bounded(stream.read(MAX_OCTETS + 1), where), "", where)
        return
    head: list[bytes] = []
    while not (head and head[-1].strip()) and (line := stream.readline()):
        head.append(line)
    is_json = bool(head) and head[-1].lstrip().startswith((b"{", b"["))
    yield from _texts(chain(head, stream), form or ("json" if is_json else "hex"), where)


def _texts(lines: Iterable[bytes], kind: str, where: str) -> Iterator[Item]:
    """Yield the PDUs of text lines, and an error for each invalid one. Raises RequestError without any."""
    count = 0
    for item in _json(lines, where) if kind == "json" else _coded(lines, kind, where):
        count += 1
        yield item
    if not count:
        raise RequestError(f"{where}: it holds no PDU", ACCEPTED)


def _coded(lines: Iterable[bytes], kind: str, where: str) -> Iterator[Item]:
    """Yield the PDUs of lines in hexadecimal or base64, one per line."""
    for number, line in enumerate(lines, 1):
        origin = f"{where}: line {number}"
        try:
            if text := line.decode().partition("#")[0].strip():
                yield Payload(_decode(kind)(text, origin), "", origin)
        except RequestError as error:
            yield error
        except UnicodeDecodeError as error:
            what = f"{origin}: octet {error.start + 1}: invalid UTF-8 in a {kind} file"
            yield RequestError(what, "for raw octets use --format binary")


def _decode(kind: str) -> Callable[[str, str], bytes]:
    if kind == "base64":
        return base64_octets
    if kind == "hex":
        return hex_octets
    raise RequestError(f"an argument cannot be {kind}", "write it to a file, or to standard input with `-`")


def hex_octets(text: str, where: str, remedy: str = ACCEPTED) -> bytes:
    """Return the octets of hexadecimal digits; blanks, tabs and colons between them are allowed.

    Raises RequestError for other characters, an odd number of digits, no octets, and more than MAX_OCTETS.
    """
    digits = text.removeprefix("0x")
    for at, letter in enumerate(digits, 1 + len(text) - len(digits)):
        if letter not in HEXADECIMAL:
            raise RequestError(f"{where}: character {at}, {letter!r}, is not a hexadecimal digit", remedy)
    joined = re.sub("[: \t]", "", digits)
    if len(joined) % 2:
        raise RequestError(f"{where}: {len(joined)} hexadecimal digits; an octet has two")
    return _bounded(bytes.fromhex(joined), where)


def base64_octets(text: str, where: str) -> bytes:
    """Return the octets of padded base64 with `+` and `/`.

    Raises RequestError for other characters, wrong padding, no octets, and more than MAX_OCTETS.
    """
    joined = text.strip()
    for at, letter in enumerate(joined.rstrip("="), 1):
        if not (letter.isascii() and (letter.isalnum() or letter in "+/")):
            raise RequestError(f"{where}: character {at}, {letter!r}, is not a base64 character")
    try:
        return _bounded(b64decode(joined, validate=True), where)
    except ValueError as error:
        raise RequestError(f"{where}: {len(joined)} characters: invalid length of base64: {error}") from error


def _bounded(octets: bytes, where: str) -> bytes:
    if not octets:
        raise RequestError(f"{where}: it has no octets")
    if len(octets) > MAX_OCTETS:
        raise RequestError(
            f"{where}: more than {MAX_OCTETS} octets: too long for a PDU", "a station sends at most 1500"
        )
    return octets


def _json(lines: Iterable[bytes], where: str) -> Iterator[Item]:
    """Yield the PDUs of JSON objects: each on one line, over several lines, or in a list."""
    for begin, text in json_texts.split(line.decode(errors="backslashreplace") for line in lines):
        origin = f"{where}: line {begin}"
        try:
            value = json_texts.parse(text, origin)
        except RequestError as error:
            yield RequestError(error.message, ACCEPTED)
            continue
        for at, item in enumerate(value if isinstance(value, list) else [value]):
            try:
                yield _item(item, f"{origin}: item {at}" if isinstance(value, list) else origin)
            except RequestError as error:
                yield error


def _item(item: object, where: str) -> Payload:
    if not isinstance(item, dict):
        raise RequestError(f"{where}: {str(item)[:40]!r} is not an object", ACCEPTED)
    kind = item.get("type", "")
    is_json = "message" in item or "fields" in item
    if is_json and isinstance(kind, str):
        kind = type_name(kind)
    if not isinstance(kind, str) or not TYPE.fullmatch(kind.lower()):
        raise RequestError(f"{where}: type {kind!r} is not a name of a type", "letters, digits and _, as in `cam`")
    for key, decode in (("hex", hex_octets), ("base64", base64_octets)):
        text = item.get(key)
        if isinstance(text, str):
            return Payload(decode(text, f"{where}: {key}"), kind.lower(), where)
    if is_json:
        body = json.dumps({key: item[key] for key in ("edition", "form", "message", "fields") if key in item}).encode()
        if len(body) > MAX_BODY:
            raise RequestError(f"{where}: JSON of {len(body)} octets; at most {MAX_BODY}", "encode it: captain encode")
        return Payload(body, kind.lower(), where, "json")
    raise RequestError(f"{where}: `message`, `fields`, `hex` or `base64` is missing", ACCEPTED)
