"""What is told of a slot that is not whole."""

import marshal
import zlib
from collections.abc import Mapping

from image import archives, bytecode, verify_slot
from image.bytecode import Module
from image.project import PROJECT

NAMES = [bytecode.name(path.relative_to(PROJECT)) for path in bytecode.sources(PROJECT)]
UNIT = "usr/lib/systemd/system/captain.service"


def program(names: list[str]) -> bytes:
    empty = b"PYZ\0magi" + (17).to_bytes(4, "big") + bytes(5) + marshal.dumps([])
    modules = archives.with_modules(empty, [Module(name, False, zlib.compress(b"")) for name in names])
    return b"\x7fELF" + archives.written(archives.Package([archives.stored("PYZ.pyz", b"z", modules)], 313, b""))


class Slot:
    """Files; a value that begins with -> is a link."""

    def __init__(self, changes: Mapping[str, bytes | None]) -> None:
        files: dict[str, bytes | None] = {
            "usr/lib/captain/captain": program(NAMES),
            "usr/share/doc/captain/licences/zmq": b"licence",
            "usr/sbin/chronyd": b"",
            UNIT: b"[Service]\nExecStart=/usr/lib/captain/captain run\nExecStartPre=-+/sbin/chronyd -x\n",
            "etc/systemd/system/x.target.wants/captain.service": b"->/" + UNIT.encode(),
            **changes,
        }
        self._files = {path: octets for path, octets in files.items() if octets is not None}

    def paths(self) -> list[str]:
        return list(self._files)

    def read(self, path: str) -> bytes:
        return self._files[path]

    def size(self, path: str) -> int:
        return len(self._files[path])

    def target(self, path: str) -> str:
        return self._files[path].decode().removeprefix("->")


def troubles(changes: Mapping[str, bytes | None]) -> dict[str, str]:
    return {check: trouble for check, trouble in verify_slot.checks(Slot(changes)) if trouble}


def test_a_slot_that_is_whole_has_no_trouble():
    assert troubles({}) == {}


def test_a_module_that_was_not_taken_along_is_named():
    less = [name for name in NAMES if name != "firmware.cli"]
    assert troubles({"usr/lib/captain/captain": program(less)}) == {
        "captain has all modules of ours": "['firmware.cli'] are missing"
    }


def test_a_program_that_a_unit_starts_and_that_is_not_there_is_named():
    assert troubles({"usr/sbin/chronyd": None}) == {
        "programs that units start": "captain.service: there is no /sbin/chronyd"
    }


def test_a_unit_that_is_wanted_and_not_there_is_named():
    link = "etc/systemd/system/y.target.wants/none.service"
    assert troubles({link: b"->/usr/lib/systemd/system/none.service"}) == {
        "units that are started": f"{link}: there is no /usr/lib/systemd/system/none.service"
    }


def test_a_slot_without_licences_and_one_that_is_too_large_are_told():
    assert troubles({"usr/share/doc/captain/licences/zmq": None}) == {
        "licences of what captain carries": "there is no usr/share/doc/captain/licences"
    }
    assert troubles({"usr/lib/captain/_internal/x": bytes(31_000_000)})["the size of captain"].endswith("at most 30")
