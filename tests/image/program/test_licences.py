"""Licences of a frozen program: of all its parts, and of nothing else."""

import marshal
import zlib
from pathlib import Path

import pytest

from image.program import licences
from image.program.contents import archives, layers
from image.program.contents.bytecode import OwnModule


@pytest.fixture
def program(tmp_path: Path) -> Path:
    """captain as a directory, with the modules zmq and serial, and two libraries."""
    folder = tmp_path / "captain"
    (folder / layers.INSIDE / "gpiod").mkdir(parents=True)
    for name in ("libssl.so.3", "libzmq-12.so.5"):
        (folder / layers.INSIDE / name).touch()
    empty = b"PYZ\0magi" + (17).to_bytes(4, "big") + bytes(5) + marshal.dumps([])
    names = ["zmq", "zmq.backend", "serial"]
    modules = archives.with_modules(empty, [OwnModule(name, False, zlib.compress(b"")) for name in names])
    package = archives.Package([archives.stored(archives.MODULES, b"z", modules)], 313, b"libpython")
    (folder / layers.NAME).write_bytes(b"\x7fELF" + archives.written(package))
    return folder


def distribution(site: Path, name: str, top: str, *notices: str) -> None:
    folder = site / f"{name}.dist-info"
    for notice in (*notices, "METADATA", "RECORD"):
        (folder / notice).parent.mkdir(parents=True, exist_ok=True)
        (folder / notice).write_text(f"{notice} of {name}")
    (folder / "RECORD").write_text(f"{top}/__init__.py,sha256=x,1\n{name}.dist-info/METADATA,sha256=y,2\n")


def test_licences_are_those_of_what_is_carried(program: Path, tmp_path: Path):
    site = tmp_path / "site"
    distribution(site, "pyzmq-27", "zmq", "licenses/LICENSE.md", "licenses/LICENSE.libsodium.txt")
    distribution(site, "pyserial-3", "serial")  # which comes without its licence
    distribution(site, "gpiod-2", "gpiod", "COPYING")  # of which a folder is carried
    distribution(site, "pip-23", "pip", "LICENSE.txt")
    distribution(site, "pyinstaller-6", "PyInstaller", "COPYING.txt")  # what starts it is of it
    notice = tmp_path / "libssl3/copyright"
    notice.parent.mkdir()
    notice.write_text("of OpenSSL")
    found = licences.documents(program, site, [notice])
    assert {name for name in found if name.startswith("licences/")} == {
        "licences/libssl3",
        "licences/gpiod-2/COPYING",
        "licences/pyinstaller-6/COPYING.txt",
        "licences/pyserial-3/METADATA",
        "licences/pyzmq-27/LICENSE.libsodium.txt",
        "licences/pyzmq-27/LICENSE.md",
    }
    assert found["licences/libssl3"] == b"of OpenSSL"
    assert {"copyright", "README.md", "CHANGELOG.md", "image/guide/flash.md"} < set(found)


@pytest.mark.parametrize(
    "line", ["libssl3: ./usr/lib/aarch64-linux-gnu/libssl.so.3", "libssl3:amd64: /usr/lib/x86_64-linux-gnu/libssl.so.3"]
)
def test_a_librarys_package_is_found_in_either_list_of_owners(program: Path, line: str):
    assert licences.of_libraries(program, f"{line}\nlibc6: ./usr/lib/libc.so.6\n") == ["libssl3"]
