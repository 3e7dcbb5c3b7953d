"""Both forms of captain, read as files."""

import subprocess
from pathlib import Path

import pytest

from image.errors import ImageError
from image.program.contents import archives, layers
from tests.programs import forms

SOURCE = '#include <stdio.h>\nint f(void);\nint f(void) { return puts("x"); }\nint main(void) { return f(); }\n'


def built(path: Path, *options: str) -> bytes:
    """An ELF file that asks for puts of the C library."""
    path.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run(["gcc", *options, "-x", "c", "-o", path, "-"], input=SOURCE, text=True, check=True)
    return path.read_bytes()


@pytest.fixture
def one_file(tmp_path: Path) -> Path:
    """A start, a compressed library, a library as it is, a page, a module."""
    library = built(tmp_path / "build/x.so", "-shared", "-fPIC")
    entries = [
        archives.compressed("zmq/_zmq.abi3.so", b"b", library),
        archives.stored("libz.so.1", b"b", library),
        archives.compressed("page.css", b"x", b"looks"),
        archives.stored(archives.SCRIPT, b"s", b"script"),
    ]
    package = archives.Package(entries, 311, b"libpython3.11.so.1.0")
    path = tmp_path / "captain-1-x86_64"
    path.write_bytes(built(tmp_path / "build/start") + archives.written(package))
    return path


def test_one_files_compiled_parts_are_its_start_and_all_libraries(one_file: Path, tmp_path: Path):
    folder = forms.unpack_file(one_file, tmp_path / "parts")
    assert sorted(path.name for path in forms.compiled(folder)) == ["0-_zmq.abi3.so", "1-libz.so.1", layers.NAME]


def test_a_floor_is_the_newest_version_of_all_parts(one_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = forms.unpack_file(one_file, tmp_path / "parts")
    row = forms.floor_row("one file", folder)
    assert row.is_ok
    assert row.seen.startswith("GLIBC_2.")
    monkeypatch.setattr(forms, "FLOOR", "2.1")
    assert not forms.floor_row("one file", folder).is_ok


def test_a_floor_of_2_4_is_below_2_36(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(forms.deb, "c_library", lambda folder: "2.4")
    assert forms.floor_row("directory", tmp_path).is_ok
    monkeypatch.setattr(forms.deb, "c_library", lambda folder: "2.38")
    assert not forms.floor_row("directory", tmp_path).is_ok


def test_a_folder_without_compiled_parts_has_no_floor(tmp_path: Path):
    with pytest.raises(ImageError, match="has no program"):
        forms.floor_row("directory", tmp_path)


@pytest.mark.parametrize(("octets", "is_ok"), [(16_000_000, True), (16_000_001, False)])
def test_a_size_is_shown_beside_its_limit(octets: int, is_ok: bool):
    row = forms.size_row("one file", octets, layers.MOST_MB_OF_FILE)
    assert (row.seen, row.goal, row.is_ok) == ("16.0 MB", "at most 16 MB", is_ok)
