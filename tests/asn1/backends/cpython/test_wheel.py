"""The wheel: pip takes it, and the same input gives the same octets."""

import csv
import io
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from asn1.backends.cpython import build


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A wheel whose module is no module."""
    (tmp_path / "captain_messages.abi3.so").write_bytes(b"\x7fELF and so on")
    return build.write_wheel(tmp_path, "0.1.0", tmp_path / "captain_messages.abi3.so", "def all() -> None: ...\n")


def test_pip_installs_it(made: Path, tmp_path: Path):
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-index",
        "--no-deps",
        "--target",
        tmp_path / "site",
        made,
    ]
    subprocess.run(command, check=True)
    assert (tmp_path / "site" / "captain_messages.abi3.so").read_bytes() == b"\x7fELF and so on"
    assert (tmp_path / "site" / "captain_messages-stubs" / "__init__.pyi").exists()


def test_its_record_lists_every_file(made: Path):
    with zipfile.ZipFile(made) as archive:
        record = archive.read("captain_messages-0.1.0.dist-info/RECORD").decode()
        assert {row[0] for row in csv.reader(io.StringIO(record))} == set(archive.namelist())


def test_the_same_input_gives_the_same_octets(made: Path, tmp_path: Path):
    before = made.read_bytes()
    again = build.write_wheel(tmp_path, "0.1.0", tmp_path / "captain_messages.abi3.so", "def all() -> None: ...\n")
    assert again == made
    assert again.read_bytes() == before
