"""Debian packages of this machine's processor: make deb."""

import hashlib
import marshal
import sys
import zlib
from pathlib import Path

import pytest

from image.errors import ImageError
from image.program import binary, native
from image.program.contents import archives, layers
from image.program.contents.bytecode import OwnModule
from image.project import version
from image.tool import run
from tests.image.program.conftest import MACHINE, dpkg


@pytest.fixture
def directory(program: Path, tmp_path: Path) -> Path:
    """captain as a directory, with the module zmq."""
    folder = tmp_path / "captain-dir"
    (folder / layers.INSIDE).mkdir(parents=True)
    empty = b"PYZ\0magi" + (17).to_bytes(4, "big") + bytes(5) + marshal.dumps([])
    modules = archives.with_modules(empty, [OwnModule("zmq", False, zlib.compress(b""))])
    package = archives.Package([archives.stored(archives.MODULES, b"z", modules)], 311, b"libpython")
    (folder / layers.NAME).write_bytes((program / "captain").read_bytes() + archives.written(package))
    (folder / layers.NAME).chmod(0o755)
    return folder


def test_both_packages_are_made_with_checksums_and_install_together(directory: Path, root: Path, tmp_path: Path):
    to = tmp_path / "deb"
    made = native.make(directory, Path(sys.executable), to)
    names = [f"captain_{version()}_{MACHINE}.deb", f"captain-box_{version()}_all.deb"]
    assert [row.path.name for row in made] == names
    assert all(row.is_ok for row in made)
    digests = {line.split()[1]: line.split()[0] for line in (to / "SHA256SUMS").read_text().splitlines()}
    assert digests == {name: hashlib.sha256((to / name).read_bytes()).hexdigest() for name in names}
    dpkg(root, "--install", *(row.path for row in made))
    assert run([root / "usr/bin/captain"]) == "captain 1.2.3\n"
    assert (root / "usr/share/doc/captain/licences").is_dir()


def test_packages_of_an_earlier_version_are_removed(directory: Path, tmp_path: Path):
    (tmp_path / "deb").mkdir()
    (tmp_path / "deb/captain_0.1_all.deb").touch()
    native.make(directory, Path(sys.executable), tmp_path / "deb")
    assert len(list((tmp_path / "deb").iterdir())) == 3


def test_licences_include_those_of_modules_and_interpreter(directory: Path):
    found = native.documents(directory, Path(sys.executable))
    assert any(name.startswith("licences/pyzmq-") for name in found)
    assert {"copyright", "firmware/guide/service.md"} < found.keys()


def test_failed_build_is_reported_with_exit_code_1(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    def fail() -> tuple[Path, Path]:
        raise ImageError("build/codec/python: has no captain_messages", "make codec comes first")

    monkeypatch.setattr(binary, "make", fail)
    assert native.main() == 1
    assert capsys.readouterr().err.startswith("deb: build/codec/python: has no captain_messages")
