"""Schemas compiled by the C back end and gcc, and asked through ctypes."""

import ctypes
import hashlib
import json
import os
import subprocess
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from asn1.backends.c import library as c
from asn1.model.types import Message, Module, Reference, Schema
from tests.asn1.importing import imported, module

ROOT = Path(__file__).resolve().parents[2]
RUNTIME = ROOT / "asn1" / "backends" / "c" / "runtime"
SHIM = Path(__file__).with_name("compiled.c")
BUILD = ROOT / "build" / "asn1-compiled"
FLAGS = ("-std=c11", "-O0", "-fPIC", "-Wall", "-Wextra", "-Wconversion", "-Werror")
ROOM = 1 << 20


class RefusedError(Exception):
    """What a function of the library returned: "out of range"."""


def schema_of(body: str, *names: str) -> Schema:
    """A schema of one ASN.1 module in which the named types are messages."""
    found = imported(module(body), *names)
    modules = {
        key: Module(key, "M", "", "test", "m.asn", "0", one.definitions, one.classes, one.sets)
        for key, one in found.items()
    }
    messages = {
        name: Message(name, name.lower(), 1, "test", Reference(module="m", name=name), (), (), 0, rank)
        for rank, name in enumerate(names)
    }
    return Schema(modules, messages)


def compiled(schema: Schema, messages: Sequence[str]) -> "Compiled":
    """The library of some messages; built once for the same sources."""
    digest = hashlib.sha256()
    made = c.generate(schema, messages, BUILD / "last")
    sources = [path for path in made if path.suffix == ".c"] + sorted((RUNTIME / "src").glob("*.c")) + [SHIM]
    headers = [path for path in made if path.suffix == ".h"] + sorted(RUNTIME.rglob("*.h"))
    for path in (*headers, *sources):
        digest.update(path.read_bytes())
    library = BUILD / f"{digest.hexdigest()[:24]}.so"
    if not library.exists():
        _build(sources, headers, library)
    return Compiled(ctypes.CDLL(str(library)))


def _build(sources: Sequence[Path], headers: Sequence[Path], library: Path) -> None:
    runtime = hashlib.sha256(b"".join(path.read_bytes() for path in headers if RUNTIME in path.parents)).hexdigest()

    def build(source: Path) -> Path:
        if RUNTIME not in source.parents:
            target = library.with_suffix(f".{source.stem}.o")
        else:
            key = hashlib.sha256(source.read_bytes() + runtime.encode()).hexdigest()[:24]
            target = BUILD / f"{source.stem}-{key}.o"
            if target.exists():
                return target
        include = [f"-I{RUNTIME / 'include'}", f"-I{RUNTIME / 'src'}", f"-I{BUILD / 'last' / 'include'}"]
        subprocess.run(["gcc", *FLAGS, *include, "-c", str(source), "-o", str(target)], check=True)
        return target

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        objects = list(pool.map(build, sources))
    subprocess.run(["gcc", "-shared", *map(str, objects), "-o", str(library)], check=True)


class Compiled:
    """Values are those of the JSON that the library reads and writes."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library
        library.captain_status_text.restype = ctypes.c_char_p

    def bits(self, name: str, value: Any, room: int = ROOM) -> str:
        """An encoding as zeros and ones, without its padding. Raises RefusedError."""
        octets, count = ctypes.create_string_buffer(room), ctypes.c_size_t()
        text = json.dumps(value).encode()
        self._check(self._library.test_encode(name.encode(), text, octets, ctypes.c_size_t(room), ctypes.byref(count)))
        return _bits(octets.raw, count.value)

    def decode(self, name: str, octets: bytes, memory: int = 1 << 24) -> Any:
        """The value of a message that fills its octets. Raises RefusedError."""
        text = ctypes.create_string_buffer(ROOM * 4)
        size, room = ctypes.c_size_t(len(octets)), ctypes.c_size_t(memory)
        self._check(self._library.test_decode(name.encode(), octets, size, room, text, ctypes.c_size_t(ROOM * 4)))
        return json.loads(text.value)

    def again(self, name: str, octets: bytes) -> bytes:
        """Decoded, and what came out encoded. Raises RefusedError."""
        made, count = ctypes.create_string_buffer(ROOM), ctypes.c_size_t()
        size, room = ctypes.c_size_t(len(octets)), ctypes.c_size_t(ROOM)
        self._check(self._library.test_again(name.encode(), octets, size, made, room, ctypes.byref(count)))
        return made.raw[: (count.value + 7) // 8]

    def of_memory(self, name: str, count: int) -> tuple[str, str]:
        """What encode and validate say of so many zero octets in a list."""
        items, made, bits = ctypes.create_string_buffer(count), ctypes.create_string_buffer(16), ctypes.c_size_t()
        value = (ctypes.c_uint64 * 2)(count, ctypes.addressof(items))
        type_ = ctypes.byref(ctypes.c_char.in_dll(self._library, f"m_{name}_type"))
        status = self._library.captain_encode(type_, value, made, ctypes.c_size_t(16), ctypes.byref(bits))
        words = self._library.captain_status_text
        return words(status).decode(), words(self._library.captain_validate(type_, value)).decode()

    def validate(self, name: str, value: Any) -> None:
        """Raises RefusedError."""
        self._check(self._library.test_validate(name.encode(), json.dumps(value).encode()))

    def to_plain(self, name: str, exact: str) -> str:
        """JSON of the plain dialect. Raises RefusedError with path and sentence."""
        return self._translated(name, exact, is_to_plain=True)

    def to_exact(self, name: str, plain: str) -> str:
        return self._translated(name, plain, is_to_plain=False)

    def _translated(self, name: str, text: str, is_to_plain: bool) -> str:
        made, why = ctypes.create_string_buffer(ROOM), ctypes.create_string_buffer(2048)
        room = ctypes.c_size_t(ROOM)
        if self._library.test_translate(name.encode(), text.encode(), is_to_plain, made, room, why):
            raise RefusedError(why.value.decode())
        return made.value.decode()

    def _check(self, status: int) -> None:
        if status:
            raise RefusedError(self._library.captain_status_text(status).decode())


def _bits(octets: bytes, count: int) -> str:
    return "".join(f"{octet:08b}" for octet in octets[: (count + 7) // 8])[:count]


def octets_of(bits: str) -> bytes:
    """Zeros and ones (blanks between them do not count), filled up with zeros."""
    bits = bits.replace(" ", "")
    bits += "0" * (-len(bits) % 8)
    return int(bits or "0", 2).to_bytes(max(1, len(bits) // 8), "big")
