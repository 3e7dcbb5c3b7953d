"""Roots that captain is frozen in."""

import subprocess
from pathlib import Path

import pytest

from image.program import frozen


def package(folder: Path, name: str, *files: str) -> Path:
    """A Debian package with files, each of its own path as content."""
    for file in files:
        path = folder / name / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(file)
    control = folder / name / "DEBIAN/control"
    control.parent.mkdir(parents=True)
    lines = [f"Package: {name}", "Version: 1", "Architecture: all", "Maintainer: nobody", "Description: none"]
    control.write_text("\n".join(lines) + "\n")
    made = folder / f"{name}_1_all.deb"
    subprocess.run(["dpkg-deb", "-b", "-Znone", folder / name, made], check=True, stdout=subprocess.DEVNULL)
    return made


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """zlib1g of Debian 12 has its library in /lib, that of Debian 13 in /usr/lib."""
    found = tmp_path / "root"
    old = package(tmp_path, "zlib1g", "lib/aarch64-linux-gnu/libz.so.1")
    new = package(tmp_path, "libssl3", "usr/lib/aarch64-linux-gnu/libssl.so.3")
    frozen.lay_out([old, new], found)
    return found


def test_a_root_with_packages_of_debian_12_has_all_libraries_in_one_folder(root: Path):
    assert sorted(path.name for path in (root / "usr/lib/aarch64-linux-gnu").iterdir()) == ["libssl.so.3", "libz.so.1"]
    assert (root / "lib").readlink() == Path("usr/lib")


def test_a_root_names_the_package_of_each_file(root: Path):
    rows = (root / frozen.OWNERS).read_text().splitlines()
    assert "zlib1g: ./lib/aarch64-linux-gnu/libz.so.1" in rows
    assert "libssl3: ./usr/lib/aarch64-linux-gnu/libssl.so.3" in rows


def test_a_root_of_a_file_that_is_no_package_is_refused(tmp_path: Path):
    (tmp_path / "a_1_all.deb").write_bytes(b"none")
    with pytest.raises(frozen.ImageError, match="ended with"):
        frozen.lay_out([tmp_path / "a_1_all.deb"], tmp_path / "root")


def test_inputs_of_the_program_are_files_that_are_there_and_the_code_that_freezes_them():
    given = frozen.inputs()
    assert [path for path in given if not path.is_file()] == []
    assert {"frozen.py", "translated.py", "archives.py", "bytecode.py", "layers.py"} <= {path.name for path in given}
