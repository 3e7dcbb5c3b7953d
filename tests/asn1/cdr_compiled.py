"""Schemas compiled with what goes to ROS 2 and back, and asked through ctypes."""

import ctypes
import hashlib
import json
import subprocess
from pathlib import Path
from typing import Any

from asn1.backends.c import library as c
from asn1.backends.ros2 import profile_etsi_its
from asn1.backends.ros2.cdr import library as cdr
from asn1.layout import layout
from asn1.model.types import Schema
from tests.asn1.compiled import BUILD, FLAGS, ROOM, RUNTIME

SHIM = Path(__file__).with_name("cdr_compiled.c")


class Report(ctypes.Structure):
    """captain_report."""

    _fields_ = (
        ("status", ctypes.c_int), ("bit", ctypes.c_size_t), ("path", ctypes.c_char * 512), ("text", ctypes.c_char * 512),
    )  # fmt: skip


class RefusedError(Exception):
    """What from_cdr says: path, octet, sentence."""

    def __init__(self, path: str, octet: int, text: str) -> None:
        super().__init__(f"{path}: octet {octet}: {text}")
        self.path, self.octet, self.text = path, octet, text


def compiled(schema: Schema) -> "Compiled":
    """The library of all messages of a schema; built once for the same sources."""
    chosen = layout.lay_out(schema, list(schema.messages.values()))
    packages = profile_etsi_its.packages(schema, list(schema.messages.values()))
    texts = [cdr.source(chosen, package) for package in packages]
    kept = sorted([*RUNTIME.rglob("*.[ch]"), *cdr.RUNTIME.rglob("*.[ch]"), SHIM])
    digest = hashlib.sha256("".join([*texts, *(path.read_text() for path in kept)]).encode()).hexdigest()[:24]
    folder, library = BUILD / f"cdr-{digest}", BUILD / f"cdr-{digest}.so"
    if not library.exists():
        c.write(chosen, folder)
        cdr.write(chosen, packages, folder)
        _build(folder, library)
    return Compiled(ctypes.CDLL(str(library)))


def _build(folder: Path, library: Path) -> None:
    sources = [*(folder / "src").glob("*.c"), *(RUNTIME / "src").glob("*.c"), SHIM]
    include = [f"-I{one}" for one in (folder / "include", folder / "src", RUNTIME / "include", RUNTIME / "src")]
    made = library.with_suffix(".new")
    subprocess.run(["gcc", *FLAGS, *include, "-shared", *map(str, sorted(sources)), "-o", str(made)], check=True)
    made.replace(library)


class Compiled:
    """Values are those of the JSON that the library reads and writes."""

    def __init__(self, library: ctypes.CDLL) -> None:
        self._library = library

    def to_cdr(self, name: str, value: Any, room: int = ROOM) -> tuple[bytes, list[str]]:
        """With the paths of what was left out."""
        made, count, left = ctypes.create_string_buffer(room), ctypes.c_size_t(), ctypes.create_string_buffer(ROOM)
        status = self._library.test_to_cdr(
            name.encode(), json.dumps(value).encode(), made, ctypes.c_size_t(room), ctypes.byref(count), left,
            ctypes.c_size_t(ROOM),
        )  # fmt: skip
        if status:
            raise ValueError(f"status {status}, {count.value} octets")
        return made.raw[: count.value], left.value.decode().split()

    def from_cdr(self, name: str, octets: bytes) -> Any:
        """Raises RefusedError."""
        text, report = ctypes.create_string_buffer(ROOM), Report()
        status = self._library.test_from_cdr(
            name.encode(), octets, ctypes.c_size_t(len(octets)), text, ctypes.c_size_t(ROOM), ctypes.byref(report)
        )
        if status:
            raise RefusedError(report.path.decode(), report.bit // 8, report.text.decode())
        return json.loads(text.value)

    def again(self, name: str, octets: bytes, takes_unknown: bool = False) -> bytes:
        """Read, and written from what was read."""
        made, count = ctypes.create_string_buffer(ROOM), ctypes.c_size_t()
        status = self._library.test_again(
            name.encode(), octets, ctypes.c_size_t(len(octets)), ctypes.c_bool(takes_unknown), made,
            ctypes.c_size_t(ROOM), ctypes.byref(count),
        )  # fmt: skip
        if status:
            raise ValueError(f"status {status}")
        return made.raw[: count.value]
