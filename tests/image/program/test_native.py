"""Debian packages of this machine's processor: make deb."""

import hashlib
import marshal
import shutil
import sys
import zlib
from pathlib import Path

import pytest

from image.errors import ImageError
from image.program import binary, developer, native
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


@pytest.fixture
def tree(directory: Path, tmp_path: Path) -> Path:
    """Files of captain-dev; a program is in place of its library."""
    folder = tmp_path / "tree"
    (folder / "usr/lib").mkdir(parents=True)
    shutil.copy(directory / layers.NAME, folder / "usr/lib/libcaptain_messages.so")
    return folder


@pytest.fixture(autouse=True)
def wheels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the wheels that were built before."""
    names = ["captain_client-0.1.0-py3-none-any.whl", "captain_messages-0.1.0-cp310-abi3-linux_x86_64.whl"]
    (tmp_path / "wheels").mkdir()
    for name in names:
        (tmp_path / "wheels" / name).write_text(name)
    monkeypatch.setattr(native, "WHEELS", tmp_path / "wheels")
    return names


def test_packages_are_made_with_wheels_and_checksums_and_install_together(
    directory: Path, tree: Path, wheels: list[str], root: Path, tmp_path: Path
):
    to = tmp_path / "deb"
    made = native.make(directory, Path(sys.executable), tree, to)
    own = f"{version()}_{MACHINE}.deb"
    names = [f"captain_{own}", f"captain-box_{version()}_all.deb", f"captain-dev_{own}", *wheels]
    assert [row.path.name for row in made] == names
    assert all(row.is_ok for row in made)
    digests = {line.split()[1]: line.split()[0] for line in (to / "SHA256SUMS").read_text().splitlines()}
    assert digests == {name: hashlib.sha256((to / name).read_bytes()).hexdigest() for name in names}
    for row in made[:3]:  # one by one: without the packages that they depend on, dpkg chooses any order
        dpkg(root, "--install", row.path)
    assert run([root / "usr/bin/captain"]) == "captain 1.2.3\n"
    assert (root / "usr/share/doc/captain/licences").is_dir()


def test_packages_of_an_earlier_version_are_removed(directory: Path, tree: Path, tmp_path: Path):
    (tmp_path / "deb").mkdir()
    (tmp_path / "deb/captain_0.1_all.deb").touch()
    native.make(directory, Path(sys.executable), tree, tmp_path / "deb")
    assert len(list((tmp_path / "deb").iterdir())) == 6


def test_licences_include_those_of_modules_and_interpreter(directory: Path):
    found = native.documents(directory, Path(sys.executable))
    assert any(name.startswith("licences/pyzmq-") for name in found)
    assert {"copyright", "firmware/guide/service.md"} < found.keys()


def test_failed_build_is_reported_with_exit_code_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def fail() -> tuple[Path, Path]:
        raise ImageError("build/codec/python: has no captain_messages", "make codec comes first")

    monkeypatch.setattr(native, "STEPS", tmp_path / "steps")
    monkeypatch.setattr(developer, "installed", lambda *_: tmp_path)
    monkeypatch.setattr(binary, "make", fail)
    assert native.main() == 1
    assert capsys.readouterr().err.startswith("deb: build/codec/python: has no captain_messages")
