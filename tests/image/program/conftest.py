"""Debian package of a small program, and a root to install packages into by dpkg, which runs their scripts."""

import os
import platform
from pathlib import Path

import pytest

from image.program import deb
from image.tool import run

MACHINE = {"x86_64": "amd64", "aarch64": "arm64"}[platform.machine()]
PROGRAM = '#include <stdio.h>\nint main(void) { return puts("captain 1.2.3") < 0; }\n'
DOCUMENTS = {"copyright": b"licence\n", "licences/zmq/LICENSE": b"other licence\n"}
# dpkg has to be root, or believe to be.
AS_ROOT = [] if os.geteuid() == 0 else ["unshare", "--map-root-user"]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """captain as a directory, as the freezer makes it."""
    folder = tmp_path_factory.mktemp("program") / "captain"
    (folder / "_internal").mkdir(parents=True)
    (folder / "_internal/base_library.zip").write_bytes(b"modules")
    (folder.parent / "main.c").write_text(PROGRAM)
    run(["gcc", "-o", folder / "captain", folder.parent / "main.c"])
    (folder / "_internal/libx.so.1").symlink_to("../captain")
    return folder


def package(program: Path, target: Path, version: str = "1.2.3") -> Path:
    deb.make(program, MACHINE, version, DOCUMENTS, 1_750_000_000, target)
    return target


@pytest.fixture(scope="module")
def made(program: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return package(program, tmp_path_factory.mktemp("made") / "captain.deb")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """An empty one, with the files that a system's users are in."""
    folder = tmp_path / "root"
    (folder / "etc").mkdir(parents=True)
    for name in ("passwd", "shadow", "gshadow"):
        (folder / "etc" / name).write_text("")
    (folder / "etc/group").write_text("dialout:x:20:\ni2c:x:21:\n")
    (folder / "var/lib/dpkg").mkdir(parents=True)
    return folder


def dpkg(root: Path, *words: str | Path) -> str:
    options = ["--force-script-chrootless", "--force-depends", "--no-triggers", f"--log={root}/log"]
    return run([*AS_ROOT, "dpkg", f"--root={root}", *options, *words])
