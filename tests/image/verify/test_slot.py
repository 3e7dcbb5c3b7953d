"""Findings in an incomplete slot."""

import marshal
import stat
import zlib
from collections.abc import Mapping

import pytest

from image.description import read
from image.parts import root
from image.program.contents import archives, bytecode
from image.program.contents.bytecode import OwnModule
from image.project import PROJECT
from image.verify import slot
from tests.said import of_key, tells

NAMES = [bytecode.name(path.relative_to(PROJECT)) for path in bytecode.sources(PROJECT)]
UNIT = "usr/lib/systemd/system/captain.service"


def program(names: list[str]) -> bytes:
    empty = b"PYZ\0magi" + (17).to_bytes(4, "big") + bytes(5) + marshal.dumps([])
    modules = archives.with_modules(empty, [OwnModule(name, False, zlib.compress(b"")) for name in names])
    return b"\x7fELF" + archives.written(archives.Package([archives.stored("PYZ.pyz", b"z", modules)], 313, b""))


OWN = read(PROJECT / "image/image.toml")
LAID = {one.path: one for one in root.overlaid(OWN)}
MODES = {one.path: one.mode for one in LAID.values()} | {"usr/bin/su": 0o4755, "usr/bin/dash": 0o4755}
MODES |= {"usr/bin/wall": 0o2755}


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

    def mode(self, path: str) -> int:
        return stat.S_IFREG | MODES.get(path, 0o644)

    def target(self, path: str) -> str:
        return self._files[path].decode().removeprefix("->")


def troubles(changes: Mapping[str, bytes | None]) -> dict[str, str]:
    return {check: trouble for check, trouble in slot.checks(Slot(changes)) if trouble}


def test_a_slot_that_is_whole_has_no_trouble():
    assert troubles({}) == {}


def test_program_without_a_module_of_ours_fails_with_its_name():
    less = [name for name in NAMES if name != "firmware.cli"]
    ((name, said),) = troubles({"usr/lib/captain/captain": program(less)}).items()
    assert "modules" in name
    assert tells(said, "['firmware.cli']", "missing")


def test_unit_whose_program_is_absent_fails_with_both():
    ((name, said),) = troubles({"usr/sbin/chronyd": None}).items()
    assert "programs" in name
    assert tells(said, "captain.service: ", "not found", ": /sbin/chronyd")


def test_unit_that_is_wanted_and_absent_fails_with_its_link():
    link = "etc/systemd/system/y.target.wants/none.service"
    ((name, said),) = troubles({link: b"->/usr/lib/systemd/system/none.service"}).items()
    assert "units" in name
    assert tells(said, f"{link}: ", "not found", ": /usr/lib/systemd/system/none.service")


def test_slot_without_licences_or_with_too_large_a_program_fails():
    ((name, said),) = troubles({"usr/share/doc/captain/licences/zmq": None}).items()
    assert "licences" in name
    assert tells(said, "not found", ": usr/share/doc/captain/licences")
    assert of_key(troubles({"usr/lib/captain/_internal/x": bytes(37_000_000)}), "size").endswith("at most 36")


# -- what the description decides


def composed(changes: Mapping[str, bytes | None]) -> dict[str, str]:
    units = {
        f"etc/systemd/system/{target}.wants/{unit}": b"->/x" for target, units in root.WANTED.items() for unit in units
    }
    files: dict[str, bytes | None] = {
        **{path: one.text.encode() for path, one in LAID.items()},
        **units,
        **{f"etc/systemd/system/{unit}": b"->/dev/null" for unit in root.MASKED},
        "etc/passwd": b"root:x:0:0:root:/root:/bin/bash\noperator:x:561:561::/home/operator:/bin/bash\n",
        "boot/Image": b"kernel",
        "usr/bin/su": b"",
        "etc/systemd/system/x.target.wants/captain.service": None,
        "usr/lib/systemd/system/captain.service": LAID[UNIT].text.encode(),
        **changes,
    }
    checks = slot.composed(Slot(files), OWN, {"boot/Image": b"kernel"})
    return {check: trouble for check, trouble in checks if trouble}


def test_a_slot_as_described_has_no_trouble():
    assert composed({}) == {}


WANTS = "etc/systemd/system/multi-user.target.wants"


@pytest.mark.parametrize(
    ("changes", "check", "said"),
    [
        ({"etc/nftables.conf": b"flush ruleset\n"}, "the box's own files", "['etc/nftables.conf'] are others, or not there"),
        ({"etc/fstab": None}, "the box's own files", "['etc/fstab'] are others, or not there"),
        ({"boot/Image": b"kernel."}, "the box's own files", "['boot/Image'] are others, or not there"),
        ({f"{slot.SSHD}/00.conf": b"PermitEmptyPasswords yes"}, "configuration of sshd", f"['{slot.SSHD}/00.conf'] are read, too"),
        ({f"{WANTS}/captain-owner.service": None}, "units that are switched on", f"{WANTS}/captain-owner.service is not"),
        ({f"{WANTS}/telnet.service": b"->/x"}, "units that are switched on", f"{WANTS}/telnet.service is"),
        ({"etc/systemd/system/getty@tty1.service": None}, "units that are switched on", "getty@tty1.service may be"),
        ({"etc/systemd/system/getty@tty1.service": b"->/x"}, "units that are switched on", "getty@tty1.service may be"),
        ({"usr/bin/dash": b""}, "setuid programs", "by ['usr/bin/dash']"),
        ({"usr/bin/wall": b""}, "setuid programs", "by ['usr/bin/wall']"),
        ({"etc/passwd": b"root:x:0:0::/:/bin/sh\ntoor:x:0:0::/:/bin/sh\n"}, "root is the only one", "['root', 'toor'] are"),
    ],
)  # fmt: skip
def test_what_was_changed_in_a_slot_is_told(changes: Mapping[str, bytes | None], check: str, said: str):
    assert composed(changes) == {check: said}


def test_a_file_of_the_box_with_another_mode_is_told(monkeypatch: pytest.MonkeyPatch):
    path = "usr/lib/captain-image/owner"
    monkeypatch.setitem(MODES, path, 0o777)
    assert composed({})["the box's own files"] == f"['{path}'] are others, or not there"
